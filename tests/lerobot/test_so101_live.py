"""LeRobot's own SO-101 follower and motor driver, on servos of the tests at the other end of a serial line."""

import asyncio
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.bench.harness.free_port import free_port
from lockstep.bench.harness.processes import running_process, started
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import Console
from tests.lerobot.commands import PATIENCE, environment, lerobot_python, newest, reach
from tests.lerobot.conftest import running_arm
from tests.lerobot.parts.feetech_bus import FeetechBus
from tests.lerobot.test_drive_live import driving

pytestmark = [pytest.mark.long, pytest.mark.timeout(1500)]

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
LIMITS = dict.fromkeys(range(1, 6), (1024, 3072)) | {6: (2000, 3000)}
STEPS_PER_DEGREE = 4095 / 360


@pytest.fixture
def bus() -> Iterator[FeetechBus]:
    found = FeetechBus(dict.fromkeys(range(1, 6), 2048) | {6: 2500}, LIMITS)
    yield found
    found.close()


def calibrated(directory: Path, kind: str = "robots/so_follower") -> None:
    """Write the file that lerobot-calibrate would have written."""
    folder = directory / "lerobot/calibration" / kind
    folder.mkdir(parents=True)
    motors = {
        name: {
            "id": number,
            "drive_mode": 0,
            "homing_offset": 0,
            "range_min": LIMITS[number][0],
            "range_max": LIMITS[number][1],
        }
        for number, name in enumerate(NAMES, 1)
    }
    (folder / "desk.json").write_text(json.dumps(motors))


def settings(bus: FeetechBus, more: str = "") -> str:
    return f"robot: so101_follower\nconfig: {{port: {bus.port}, id: desk}}\n{more}"


def has_torque(bus: FeetechBus) -> bool:
    return bus.servos[2].has_torque


async def test_its_joints_are_degrees_and_follow_goals_and_its_torque_stays_on(bus: FeetechBus, tmp_path: Path) -> None:
    calibrated(tmp_path)
    async with (
        running_arm(tmp_path, settings(bus)) as arm,
        Console(arm.stack.operator, audio=False, video=False) as console,
    ):
        axes = {axis.name: axis for axis in console.description.axes}
        assert list(axes) == [f"{name}.pos" for name in NAMES]
        assert [axis.unit for axis in axes.values()] == ["deg"] * 5 + ["%"]
        assert axes["elbow_flex.pos"].maximum == pytest.approx(1024 / STEPS_PER_DEGREE)
        await newest(console)
        assert console.feedback is not None
        axes_now = console.feedback.axes
        assert [*axes_now[:1], *axes_now[2:]] == pytest.approx([0.0] * 4 + [50.0], abs=0.2)
        assert console.feedback.goals == pytest.approx(axes_now, abs=1.0)  # the lift stays where it sank to meanwhile
        await console.take_seat()
        await reach(console, {"shoulder_pan.pos": 45.0, "gripper.pos": 10.0})
        assert bus.place(1) == pytest.approx(2048 + 45 * STEPS_PER_DEGREE, abs=30)
        assert bus.place(6) == pytest.approx(2100, abs=60)
        assert bus.place(3) == pytest.approx(2048, abs=5)
    assert all(servo.has_torque for servo in bus.servos.values())


async def test_a_page_leads_lerobots_own_follower(bus: FeetechBus, tmp_path: Path) -> None:
    """`lerobot-teleoperate` with the teleoperator that is a robot for a console."""
    calibrated(tmp_path)
    port = free_port()
    leads = (
        "--teleop.type=lockstep",
        "--teleop.source=page",
        f"--teleop.port={port}",
        "--teleop.start={gripper.pos: 50}",
    )
    follows = ("--robot.type=so101_follower", f"--robot.port={bus.port}", "--robot.id=desk")
    teleoperate = (str(Path(lerobot_python()).with_name("lerobot-teleoperate")), *follows, *leads, "--fps=20")
    own = {**environment(tmp_path), "LOCKSTEP_PYTHON": sys.executable}
    serve = (str(LOCKSTEP), "serve", "--robot", f"tcp://127.0.0.1:{port}", "--port", "0", "--json")
    async with started(teleoperate, environment=own) as command:
        await command.listening(port)
        async with (
            running_process(*serve, "--state-dir", str(tmp_path / "state")) as (_, links),
            Console(links["operator"], audio=False, video=False) as console,
        ):
            await console.take_seat()
            await reach(console, {"shoulder_pan.pos": 45.0, "gripper.pos": 10.0})
            async with asyncio.timeout(PATIENCE):
                while abs(bus.place(1) - 2048 - 45 * STEPS_PER_DEGREE) > 30 or abs(bus.place(6) - 2100) > 60:  # noqa: ASYNC110
                    await asyncio.sleep(0.05)
            assert bus.place(3) == pytest.approx(2048, abs=5)


async def test_lerobots_own_leader_leads_an_arm_only_while_the_key_is_held(bus: FeetechBus, tmp_path: Path) -> None:
    """`lockstep drive --teleop so101_leader`; a hand moves its motors."""
    calibrated(tmp_path, "teleoperators/so_leader")
    leader = ("--teleop", "so101_leader", f"--teleop.port={bus.port}", "--teleop.id=desk")
    async with (
        running_arm(tmp_path) as arm,
        Console(arm.stack.observer, audio=False, video=False) as watching,
        driving(tmp_path, arm.stack.operator, *leader, "--map", "shoulder_pan.pos=pan.pos*1") as terminal,
    ):
        await terminal.says("hold the space bar")
        before = (await newest(watching)).axes[0]
        bus.turn(1, 20 * STEPS_PER_DEGREE)  # nobody holds the key
        async with terminal.holding(" "):
            await terminal.says("drives")
            for _ in range(15):
                bus.turn(1, STEPS_PER_DEGREE)
                await asyncio.sleep(0.05)
            async with asyncio.timeout(PATIENCE):
                async for feedback in watching.feedbacks():
                    if abs(feedback.axes[0] - before - 15.0) < 1.5:
                        break
        await terminal.says("rests")
        bus.turn(1, -30 * STEPS_PER_DEGREE)
        await asyncio.sleep(1.0)
        assert watching.feedback is not None
        assert watching.feedback.axes[0] == pytest.approx(before + 15.0, abs=1.5)
        assert not bus.servos[1].has_torque, "a hand has to move it"


async def test_motors_that_are_silent_make_the_state_unknown(bus: FeetechBus, tmp_path: Path) -> None:
    calibrated(tmp_path)
    async with (
        running_arm(tmp_path, settings(bus)) as arm,
        Console(arm.stack.operator, audio=False, video=False) as console,
    ):
        bus.unplug()
        async with asyncio.timeout(PATIENCE):
            async for feedback in console.feedbacks():
                if any("no reading for" in fault or "has not answered" in fault for fault in feedback.faults):
                    break


async def test_a_stop_takes_the_torque_where_the_settings_say_so_and_a_reset_does_not_leap(
    bus: FeetechBus, tmp_path: Path
) -> None:
    calibrated(tmp_path)
    async with (
        running_arm(tmp_path, settings(bus, "stop: torque_off\n")) as arm,
        Console(arm.stack.operator, audio=False, video=False) as console,
    ):
        await console.take_seat()
        await console.stop()
        async with asyncio.timeout(PATIENCE):
            # It may have sunk that far already while LeRobot configured it on a busy machine.
            while has_torque(bus) or bus.place(2) > 1500:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        await asyncio.sleep(1.0)  # the bridge takes no reset within a second
        await console.reset()
        fallen = bus.place(2)
        async with asyncio.timeout(PATIENCE):
            while not has_torque(bus):  # noqa: ASYNC110
                await asyncio.sleep(0.02)
        await asyncio.sleep(0.5)
        assert bus.place(2) <= fallen + 20  # not back to where it was told to be before
