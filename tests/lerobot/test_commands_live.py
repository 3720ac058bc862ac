"""LeRobot's own record, replay and teleoperate, with the plugins, on an arm behind a console."""

import asyncio
import json
import math
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as parquet
import pytest

from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.client import CommandRefused, Console
from lockstep.emulator.namespace.network_process import NetworkProcess
from tests.lerobot.commands import PATIENCE, Arm, environment, lerobot_python, newest, reach, run_driving, run_lerobot

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400)]

FPS = 10
SECONDS = 3
LEADER = ("--teleop.type=scripted", "--teleop.discover_packages_path=tests.lerobot.parts")
GREY = 128  # of the picture at 0 degrees
STEPS = 45  # actions of one swing: at most 2.1 degrees each
NEAR = 12.0  # degrees: the picture may be four events older, and JPEG and H.264 blur
HELD_UP = 0.5  # s; the watchdog acts after 0.2
# A busy machine has no fresh observation for longer than a robot's operator would wait.
PATIENT = ("--robot.observation_timeout_s=120", "--robot.connect_timeout_s=300")


def dataset_flags(directory: Path, name: str, episodes: int) -> tuple[str, ...]:
    return (
        f"--dataset.repo_id=tests/{name}",
        f"--dataset.root={directory / name}",
        "--dataset.single_task=swing",
        f"--dataset.fps={FPS}",
        f"--dataset.episode_time_s={SECONDS}",
        "--dataset.reset_time_s=1",
        f"--dataset.num_episodes={episodes}",
        "--dataset.push_to_hub=false",
        "--dataset.vcodec=h264",
        "--play_sounds=false",
    )


def rows(folder: Path) -> dict[str, list[Any]]:
    (file,) = sorted(folder.glob("data/**/*.parquet"))
    found: dict[str, list[Any]] = parquet.read_table(file).to_pydict()
    return found


def greys(folder: Path) -> list[float]:
    (file,) = sorted(folder.glob("videos/**/*.mp4"))
    with av.open(str(file)) as video:
        return [float(frame.to_ndarray(format="rgb24").mean()) for frame in video.decode(video=0)]


async def test_record_makes_a_dataset_whose_pictures_are_of_its_states_and_replay_moves_the_arm(
    arm: Arm, tmp_path: Path
) -> None:
    folder = tmp_path / "swing"
    stack = await run_driving(
        *(arm, tmp_path, "lerobot-record", "--robot.type=lockstep", "--robot.id=recorder", *LEADER),
        *(f"--teleop.steps={STEPS}", *PATIENT, *dataset_flags(tmp_path, "swing", 2)),
        dataset=folder,
    )
    info = json.loads((folder / "meta/info.json").read_text())
    assert info["robot_type"] == "lockstep"
    assert info["total_episodes"] == 2
    assert info["features"]["action"]["names"] == ["pan.pos", "lift.pos", "gripper.pos"]
    assert info["features"]["observation.images.front"]["shape"] == [48, 64, 3]
    table = rows(folder)
    states, pictures = np.array(table["observation.state"])[:, 0], np.array(greys(folder))
    assert len(states) == len(pictures)
    assert np.ptp(states) > 10.0  # it did swing
    assert np.abs(pictures - GREY - states).max() < NEAR
    assert len(await stack.events("executed")) >= len(states)  # each row is one event, and more are between them
    stack = await run_driving(
        *(arm, tmp_path, "lerobot-replay", "--robot.type=lockstep", "--dataset.repo_id=tests/swing"),
        *(f"--dataset.root={folder}", "--dataset.episode=1", "--play_sounds=false", *PATIENT),
    )
    assert len(await stack.events("executed")) >= table["episode_index"].count(1) > 0
    async with Console(arm.stack.operator, audio=False, video=False) as console:
        assert console.seat.holder == ""  # given back
        await newest(console)
        assert console.feedback is not None
        assert console.feedback.at_rest


async def test_record_replay_and_teleoperate_work_across_the_hong_kong_network(arm: Arm, tmp_path: Path) -> None:
    folder = tmp_path / "far"
    async with NetworkProcess("hong-kong") as network:
        await network.open_console(arm.stack.console)
        network.begin()
        await run_driving(
            *(arm, tmp_path, "lerobot-record", "--robot.type=lockstep", *LEADER, f"--teleop.steps={STEPS}"),
            *(*PATIENT, *dataset_flags(tmp_path, "far", 1)),
            dataset=folder,
            link=network.link(arm.stack.operator),
        )
        states, pictures = np.array(rows(folder)["observation.state"])[:, 0], np.array(greys(folder))
        assert len(states) == len(pictures) > 5
        assert np.ptp(states) > 5.0
        assert np.abs(pictures - GREY - states).max() < NEAR
        far = network.link(arm.stack.operator)
        stack = await run_driving(
            *(arm, tmp_path, "lerobot-replay", "--robot.type=lockstep", "--dataset.repo_id=tests/far"),
            *(f"--dataset.root={folder}", "--dataset.episode=0", "--play_sounds=false", *PATIENT),
            link=far,
        )
        assert len(await stack.events("executed")) >= len(states)
        here = await arm.stack.from_here()
        await run_driving(
            *(arm, tmp_path, "lerobot-teleoperate", "--robot.type=lockstep", *LEADER),
            *("--fps=10", f"--teleop_time_s={SECONDS}", *PATIENT),
            link=far,
        )
    executed = await here.events("executed")
    places = [each["values"][0] for each in executed if each["values"][0] is not None]
    assert max(places) - min(places) > 5.0
    assert (await here.events("at_rest"))[-1]["time"] > executed[-1]["time"]


async def test_teleoperate_drives_and_leaves_the_arm_at_rest(arm: Arm, tmp_path: Path) -> None:
    async with Console(arm.stack.observer, audio=False, video=False) as watching:
        places: list[float] = []

        async def watch() -> None:
            async for feedback in watching.feedbacks():
                places.append(feedback.axes[0])

        task = asyncio.create_task(watch())
        try:
            await run_driving(
                *(arm, tmp_path, "lerobot-teleoperate", "--robot.type=lockstep", *LEADER),
                *("--fps=15", f"--teleop_time_s={SECONDS}", *PATIENT),
            )
        finally:
            task.cancel()
            await asyncio.wait([task])
        assert max(places) - min(places) > 10.0
        await newest(watching)
        assert watching.feedback is not None
        assert watching.feedback.at_rest


async def test_record_watches_while_a_person_drives_from_the_page(arm: Arm, tmp_path: Path) -> None:
    """The person is a headless client here; the actions of the dataset are the goals that the arm was given."""
    async with Console(arm.stack.operator, audio=False, video=False, name="person") as person:
        await person.take_seat()
        loop = asyncio.get_running_loop()

        async def drive() -> None:
            began = loop.time()
            while True:
                with suppress(CommandRefused):  # a busy machine holds the arm up
                    await person.arm()
                    while True:
                        await person.drive({"pan.pos": 10.0 + 15.0 * math.sin(loop.time() - began)})

        task = asyncio.create_task(drive())
        try:
            await run_lerobot(
                *(tmp_path, "lerobot-record", "--robot.type=lockstep", "--robot.drive=false", "--teleop.type=lockstep"),
                *("--teleop.observation_timeout_s=120", "--teleop.connect_timeout_s=300", *PATIENT),
                *dataset_flags(tmp_path, "watched", 1),
                link=arm.stack.observer,
            )
        finally:
            task.cancel()
            await asyncio.wait([task])
    table = rows(tmp_path / "watched")
    actions, states = np.array(table["action"])[:, 0], np.array(table["observation.state"])[:, 0]
    assert np.ptp(actions) > 5.0
    # Each action was read after the state of its row and before that of the next one, however long that took.
    between = np.sort(np.stack([states[:-1], states[1:]]), axis=0)
    assert (actions[:-1] > between[0] - NEAR).all()
    assert (actions[:-1] < between[1] + NEAR).all()


async def test_a_stopped_robot_is_not_driven_and_the_command_says_why(arm: Arm, tmp_path: Path) -> None:
    async with Console(arm.stack.operator, audio=False, video=False) as console:
        await console.stop("a person is near")
    with pytest.raises(AssertionError, match="stopped"):
        await run_lerobot(
            *(tmp_path, "lerobot-teleoperate", "--robot.type=lockstep", *LEADER, *PATIENT),
            *("--fps=15", "--teleop_time_s=2"),
            link=arm.stack.operator,
        )


async def test_a_console_that_is_lost_ends_the_command_which_says_why_and_the_arm_rests(
    arm: Arm, tmp_path: Path
) -> None:
    ended = asyncio.Event()

    async def lose() -> None:
        await _driven(arm)
        with arm.stack.frozen_console():
            await ended.wait()

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(lose())
        try:
            with pytest.raises(AssertionError, match="ConsoleLost"):
                await run_lerobot(
                    *(tmp_path, "lerobot-teleoperate", "--robot.type=lockstep", *LEADER, *PATIENT),
                    *("--fps=15", "--teleop_time_s=300"),
                    link=arm.stack.operator,
                )
        finally:
            ended.set()
    executed, rests = await arm.stack.events("executed"), await arm.stack.events("at_rest")
    assert rests[-1]["time"] > executed[-1]["time"], "it came to rest by itself"


async def _driven(arm: Arm) -> None:
    """Until the arm has moved."""
    async with Console(arm.stack.observer, audio=False, video=False) as watching:
        async for feedback in watching.feedbacks():
            if abs(feedback.axes[0] - 10.0) > 2.0:
                return


async def test_a_bridge_that_its_machine_held_up_ends_the_command_which_says_why(arm: Arm, tmp_path: Path) -> None:
    async def hold_up() -> None:
        await _driven(arm)
        with arm.stack.frozen_bridge():
            await asyncio.sleep(HELD_UP)

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(hold_up())
        with pytest.raises(AssertionError, match="NotArmed"):
            await run_lerobot(
                *(tmp_path, "lerobot-teleoperate", "--robot.type=lockstep", *LEADER, *PATIENT),
                *("--fps=15", "--teleop_time_s=300"),
                link=arm.stack.operator,
            )
    assert await arm.stack.events("stall")


A_PAGE = """
import json, sys
from lerobot_teleoperator_lockstep import LockstepTeleoperator, LockstepTeleoperatorConfig
leader = LockstepTeleoperator(LockstepTeleoperatorConfig(source="page", port=0, start={"gripper.pos": 40.0}))
assert list(leader.action_features)[-1] == "gripper.pos", leader.action_features
leader.connect()
print(json.dumps({"robot": leader.address}), flush=True)
for line in sys.stdin:
    print(json.dumps(leader.get_action()), flush=True)
leader.disconnect()
"""


async def test_a_page_leads_a_robot_of_lerobot(tmp_path: Path) -> None:
    own = {**environment(tmp_path), "LOCKSTEP_PYTHON": sys.executable, "HOME": str(tmp_path)}
    async with running_process(lerobot_python(), "-c", A_PAGE, environment=own) as (leader, ready):
        serve = (str(LOCKSTEP), "serve", "--robot", str(ready["robot"]), "--port", "0", "--json")
        async with (
            running_process(*serve, "--state-dir", str(tmp_path / "state")) as (_, console_ready),
            Console(console_ready["operator"], audio=False, video=False) as console,
        ):
            before = await leader.ask("", PATIENCE)
            assert before["gripper.pos"] == 40.0
            await console.take_seat()
            await reach(console, {"shoulder_pan.pos": 20.0})
            assert (await leader.ask("", PATIENCE))["shoulder_pan.pos"] == pytest.approx(20.0, abs=2.0)
