"""An arm behind a controller of velocities that never times out: each motion has to end in zeros, also after a kill."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from lockstep.protocol.errors import LinkError
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.robot_bridge.bridge_helpers import Operator
from tests.support.ros2 import PATIENCE, RosBridge, RosRobot, have_ros, running_ros_bridge, running_ros_robot

pytestmark = [
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
]

JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
GO = [0.4, 0.0, 0.0, 0.0, 0.0, -0.2]
STILL = [0.0] * 6


@pytest.fixture
async def node(tmp_path: Path) -> AsyncIterator[RosRobot]:
    async with running_ros_robot(tmp_path) as robot:
        yield robot


@pytest.fixture
async def bridge(tmp_path: Path, node: RosRobot) -> AsyncIterator[RosBridge]:
    settings = tmp_path / "velocities.yaml"
    settings.write_text(
        "name: velocities\nwatchdog: 0.4\narm:\n"
        "  command: {topic: /arm_velocity_controller/commands, message: Float64MultiArray}\n  joints:\n"
        + "".join(f"    - {{name: {name}, maximum: 1.0}}\n" for name in JOINTS)
    )
    async with running_ros_bridge(tmp_path, node, settings) as running:
        yield running


async def ready(link: RobotLink) -> Operator:
    driver = Operator(link)
    await driver.next(Feedback)
    async with asyncio.timeout(PATIENCE):
        await driver.heard(lambda feedback: feedback.faults == [] and feedback.unknown == [])
    await driver.arm()
    return driver


def ended(notes: list[dict[str, Any]]) -> bool:
    return any(note["values"] == GO for note in notes) and notes[-1]["values"] == STILL


async def test_velocities_reach_the_controller_and_end_in_zeros_once(bridge: RosBridge, node: RosRobot) -> None:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = await ready(link)
        async with asyncio.timeout(PATIENCE):
            while driver.feedback.joints[0] < 0.2:
                await driver.drive(GO)
            await driver.heard(lambda feedback: feedback.at_rest)
        assert driver.feedback.joints[5] < 0
        notes = await node.noted("velocities", ended)
        for _ in range(5):  # a further word would come within two of the bridge's repeats
            await node.tell("tick")
    notes = list(node.notes("velocities"))
    assert all(0 <= note["values"][0] <= 0.4 for note in notes)
    assert [note["values"] for note in notes].count(STILL) == 1
    assert not list(node.notes("trajectory"))


async def test_a_killed_bridge_leaves_no_arm_that_moves_on(bridge: RosBridge, node: RosRobot) -> None:
    async with asyncio.timeout(2 * PATIENCE):
        with contextlib.suppress(LinkError, AssertionError, TimeoutError):
            async with RobotLink(*bridge.address, "operator", name="test") as link:
                driver = await ready(link)
                while not any(note["values"] == GO for note in node.notes("velocities")):
                    await driver.drive(GO)
                await bridge.process.kill()
        await node.noted("velocities", ended)
