"""LeRobot's record and replay on an arm whose tool has a pose: an action has the joints, which say all that happens."""

import asyncio
import json
from contextlib import AsyncExitStack
from pathlib import Path

import numpy as np
import pytest

from lockstep.client import Console
from tests.e2e.so101 import SO101, needs_so101
from tests.lerobot.commands import PATIENCE, Arm, newest, run_driving, run_lerobot
from tests.lerobot.sessions import drive, so101_tool
from tests.lerobot.test_commands_live import PATIENT, dataset_flags, rows
from tests.support.stack import running_stack

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400), needs_so101]

JOINTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
TOOL = ["x", "y", "z", "rx", "ry", "rz"]
NEAR = 0.06  # rad, of the last goal: an arm under its own load hangs lower
BLIND = ("--robot.pictures=false",)


async def test_what_a_person_drove_by_the_tools_pose_is_recorded_and_replayed_by_the_joints(tmp_path: Path) -> None:
    async with AsyncExitStack() as open_things:
        stack = await open_things.enter_async_context(
            running_stack(tmp_path, robot="so101", settings=SO101, ready_seconds=PATIENCE)
        )
        async with Console(stack.operator, audio=False, video=False, name="person") as person:
            await person.take_seat()
            driving = asyncio.create_task(drive(person, so101_tool, PATIENCE))
            try:
                await run_lerobot(
                    *(tmp_path, "lerobot-record", "--robot.type=lockstep", "--robot.drive=false", *BLIND),
                    *("--teleop.type=lockstep", "--teleop.observation_timeout_s=120"),
                    *("--teleop.connect_timeout_s=300", *PATIENT, *dataset_flags(tmp_path, "posed", 1)),
                    *("--dataset.video=false",),
                    link=stack.observer,
                )
            finally:
                driving.cancel()
                await asyncio.wait([driving])
            person.release_seat()
        features = json.loads((tmp_path / "posed/meta/info.json").read_text())["features"]
        assert features["action"]["names"] == JOINTS
        assert features["observation.state"]["names"] == [*JOINTS, *(f"tool.{axis}" for axis in TOOL)]
        recorded = np.array(rows(tmp_path / "posed")["action"])
        assert np.ptp(recorded[:, 0]) > 0.05, "the tool went to and fro by the pan"
        replayed = await run_driving(
            *(Arm(stack, tmp_path), tmp_path, "lerobot-replay", "--robot.type=lockstep", *BLIND, *PATIENT),
            *(
                "--dataset.repo_id=tests/posed",
                f"--dataset.root={tmp_path / 'posed'}",
                "--dataset.episode=0",
                "--play_sounds=false",
            ),
        )
        assert len(await replayed.events("executed")) >= len(recorded)
        assert not [each for each in await replayed.events("refused") if each["reason"] in ("conflict", "jump")]
        async with Console(stack.observer, audio=False, video=False) as watching:
            there = (await newest(watching)).axes[: len(JOINTS)]
        assert np.abs(np.array(there) - recorded[-1]).max() < NEAR
