"""`lockstep up --lerobot`: an arm behind LeRobot's classes is driven, fails, hangs and ends."""

import asyncio
import json
import os
from contextlib import suppress
from pathlib import Path

import pytest

import lockstep.protocol
import lockstep.robot_bridge
from lockstep.client import CommandRefused, Console, ConsoleLost
from lockstep.protocol.messages import Feedback
from tests.lerobot.commands import PATIENCE, Arm, environment, lerobot_python, newest, reach
from tests.lerobot.conftest import SETTINGS, running_arm

pytestmark = [pytest.mark.long, pytest.mark.timeout(1500)]


async def feedback_with(console: Console, fault: str) -> Feedback:
    async with asyncio.timeout(PATIENCE):
        async for feedback in console.feedbacks():
            if any(fault in each for each in feedback.faults):
                return feedback
    raise AssertionError("the feedback ended")


async def test_its_axes_are_what_lerobot_calls_them_and_goals_move_it(arm: Arm) -> None:
    async with Console(arm.stack.operator, audio=False) as console:
        axes = {axis.name: axis for axis in console.description.axes}
        assert {name: axis.unit for name, axis in axes.items()} == {
            "pan.pos": "deg",
            "lift.pos": "deg",
            "gripper.pos": "%",
        }
        assert axes["pan.pos"].maximum == pytest.approx(180.0)
        assert axes["lift.pos"].maximum == pytest.approx(90.0, abs=0.1)
        await newest(console)
        assert console.feedback is not None
        assert console.feedback.axes == pytest.approx([10.0, -20.0, 50.0])  # nothing has moved it
        await console.take_seat()
        reached = await reach(console, {"pan.pos": 60.0, "gripper.pos": 0.0})
        assert reached.axes[0] == pytest.approx(60.0, abs=2.0)
        with pytest.raises(CommandRefused, match="jump"):
            await console.drive({"pan.pos": 170.0})
        async for picture in console.pictures():
            if picture.frame.to_ndarray(format="rgb24").mean() > 180:  # 128 and the pan's degrees
                break


async def test_a_camera_that_is_silent_is_a_fault_and_the_arm_is_driven_on(arm: Arm) -> None:
    async with Console(arm.stack.operator, audio=False) as console:
        await console.take_seat()
        arm.trouble("dark")
        await feedback_with(console, "front: no picture for")
        reached = await reach(console, {"pan.pos": 20.0})
        assert reached.unknown == []


async def test_an_arm_without_a_state_is_not_driven(arm: Arm) -> None:
    async with Console(arm.stack.operator, audio=False) as console:
        await console.take_seat()
        arm.trouble("blind")
        blind = await feedback_with(console, "state: no reading for")
        assert "pan.pos" in blind.unknown
        with pytest.raises(CommandRefused):
            await console.drive({"pan.pos": 12.0})


@pytest.mark.parametrize(("what", "said"), [("raise", "the bus is unplugged"), ("hang", "has not answered")])
async def test_an_arm_that_fails_or_hangs_ends_the_bridge_which_begins_anew_stopped(
    arm: Arm, what: str, said: str
) -> None:
    async with Console(arm.stack.operator, audio=False) as console:
        epoch = console.epoch
        arm.trouble(what)
        failed = await feedback_with(console, said)
        assert failed.stop.stopped
        (arm.directory / "trouble").unlink()
        with suppress(ConsoleLost):
            async with asyncio.timeout(PATIENCE):
                async for _ in console.feedbacks():
                    pass
    async with Console(arm.stack.operator, audio=False, connect_seconds=PATIENCE) as console:
        assert console.epoch != epoch
        assert (await newest(console)).stop.stopped


async def test_the_bridge_leaves_the_torque_on_although_lerobot_would_switch_it_off(tmp_path: Path) -> None:
    async with running_arm(tmp_path) as arm:
        pass
    assert any("disconnected, torque on" in line for line in arm.stack.running.output.lines)


async def test_the_torque_goes_at_the_end_where_the_settings_say_so(tmp_path: Path) -> None:
    async with running_arm(tmp_path, SETTINGS + "stop: torque_off\n") as arm:
        link = arm.stack.operator
        async with Console(link, audio=False) as console:
            await console.take_seat()
            await reach(console, {"pan.pos": 20.0})
            await console.stop()
            async with asyncio.timeout(PATIENCE):
                async for feedback in console.feedbacks():
                    if feedback.axes[1] < -40.0:  # it falls
                        break
            await asyncio.sleep(1.0)  # the bridge takes no reset within a second
            await console.reset()
            fallen = await console.arm()
            await asyncio.sleep(0.5)
            await newest(console)
            assert console.feedback is not None
            assert console.feedback.axes[1] <= fallen.axes[1] + 1.0  # it does not leap back up
            assert (await reach(console, {"lift.pos": -20.0})).axes[1] == pytest.approx(-20.0, abs=2.0)
    assert any("disconnected, torque off" in line for line in arm.stack.running.output.lines)


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (("--type", "so101"), "LeRobot has no robot 'so101'"),
        (("--type=so101_follower", "--robot.colour=red"), "colour"),
        (("tests.lerobot.parts.tiny_arm:TinyArm", "--robot.calibrated=false"), "lerobot-calibrate"),
        (("tests.lerobot.parts.tiny_arm:TinyBus",), "does not inherit lerobot.robots.Robot"),
    ],
)
async def test_what_cannot_be_a_robot_is_said_in_one_line(tmp_path: Path, flags: tuple[str, ...], said: str) -> None:
    process = await asyncio.create_subprocess_exec(
        *(lerobot_python(), "-m", "lockstep.robot_bridge", "lerobot", *flags, "--port", "0"),
        *("--state-dir", str(tmp_path / "state")),
        stdin=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
        env=_paths(tmp_path),
    )
    async with asyncio.timeout(PATIENCE):
        _, printed = await process.communicate()
    assert process.returncode in (1, 2)
    last = printed.decode().splitlines()[-1]
    assert last.startswith("lockstep robot: ")
    assert said in last


async def test_the_flags_of_lerobots_commands_make_a_robot_too(tmp_path: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        *(lerobot_python(), "-m", "lockstep.robot_bridge", "lerobot", "tests.lerobot.parts.tiny_arm:TinyArm"),
        *("--robot.id=shelf", "--robot.picture", "false", "--port", "0", "--json"),
        *("--state-dir", str(tmp_path / "state")),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        env=_paths(tmp_path),
    )
    try:
        assert process.stdout is not None
        async with asyncio.timeout(PATIENCE):
            assert json.loads(await process.stdout.readline())["robot"].startswith("tcp://")
    finally:
        process.terminate()
        await process.wait()
    assert process.returncode == 0


def _paths(directory: Path) -> dict[str, str]:
    parts = [str(Path(part.__path__[0]).parents[1]) for part in (lockstep.protocol, lockstep.robot_bridge)]
    own = environment(directory)
    return {**os.environ, **own, "PYTHONPATH": os.pathsep.join([own["PYTHONPATH"], *parts])}
