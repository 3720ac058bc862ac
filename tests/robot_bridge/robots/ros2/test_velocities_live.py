"""An arm that takes velocities of its joints or its tool and never times out: motions end in zeros, also by a kill."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from lockstep.protocol.errors import LinkError
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.robot_bridge.robots.ros2.description import SERVO_AXES
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


SETTINGS = {
    "velocities": "name: velocities\nwatchdog: 0.4\narm:\n"
    "  command: {topic: /arm_velocity_controller/commands, message: Float64MultiArray}\n  joints:\n"
    + "".join(f"    - {{name: {name}, maximum: 1.0}}\n" for name in JOINTS),
    "tool": "name: tool\nwatchdog: 0.4\nservo:\n  linear: 0.5\n  angular: 1.0\n"
    "  command: {frame: tool0}\n  status: {message: Int8}\n"
    f"  joints: [{', '.join(JOINTS)}]\n",
}


@pytest.fixture
def how() -> str:
    return "velocities"


@pytest.fixture
async def bridge(how: str, tmp_path: Path, node: RosRobot) -> AsyncIterator[RosBridge]:
    settings = tmp_path / f"{how}.yaml"
    settings.write_text(SETTINGS[how])
    async with running_ros_bridge(tmp_path, node, settings) as running:
        yield running


async def ready(link: RobotLink, unknown: Sequence[str] = ()) -> Operator:
    driver = Operator(link)
    await driver.next(Feedback)
    async with asyncio.timeout(PATIENCE):
        await driver.heard(lambda feedback: feedback.faults == [] and feedback.unknown == list(unknown))
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


@pytest.mark.parametrize("how", ["tool"])
async def test_twists_of_the_tool_reach_servo_with_its_status_shown_and_end_in_a_zero(
    bridge: RosBridge, node: RosRobot
) -> None:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = await ready(link, SERVO_AXES)
        async with asyncio.timeout(PATIENCE):
            while driver.feedback.joints[0] < 0.2 or driver.feedback.joints[5] > -0.1:
                await driver.drive([0.4, 0.0, 0.0, -0.2, 0.0, 0.0])  # the axes' order has rz before rx and ry
            await driver.heard(lambda feedback: feedback.at_rest)
        assert driver.feedback.unknown == list(SERVO_AXES), "no topic says how fast the tool is"
        notes = await node.noted("tool", ended)
        await node.tell("status 2")
        async with asyncio.timeout(PATIENCE):
            await driver.heard(
                lambda feedback: feedback.faults == ["/servo_node/status: MoveIt Servo reports status 2"]
            )
    assert [note["values"] for note in notes].count(STILL) == 1
    assert {note["frame"] for note in notes} == {"tool0"}


@pytest.mark.parametrize("how", ["velocities", "tool"])
async def test_a_killed_bridge_leaves_no_arm_that_moves_on(how: str, bridge: RosBridge, node: RosRobot) -> None:
    values = GO if how == "velocities" else [0.4, 0.0, 0.0, -0.2, 0.0, 0.0]
    killed = False
    async with asyncio.timeout(2 * PATIENCE):
        with contextlib.suppress(LinkError):  # the goodbye to a bridge that is dead
            async with RobotLink(*bridge.address, "operator", name="test") as link:
                driver = await ready(link, SERVO_AXES if how == "tool" else ())
                while not any(note["values"] == GO for note in node.notes(how)):
                    await driver.drive(values)
                await bridge.process.kill()
                killed = True
        assert killed
        await node.noted(how, ended)
