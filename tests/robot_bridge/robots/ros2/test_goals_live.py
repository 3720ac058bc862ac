"""An arm behind ROS 2 that is driven by goals, against a real node: what its controller got is the truth."""

import asyncio
import itertools
from collections.abc import AsyncIterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from lockstep.protocol.messages import Feedback, Stop
from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.robot_bridge.bridge_helpers import Operator
from tests.robot_bridge.robots.pose_driver import ended, send_to
from tests.robot_bridge.robots.ros2.test_tool_settings import JOINTS, ROWS
from tests.robot_bridge.robots.ros2.test_tool_settings import settings as written
from tests.support.ros2 import PATIENCE, RosBridge, RosRobot, have_ros, running_ros_bridge, running_ros_robot

pytestmark = [
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
]

TOOL = "  tool: {tip: wrist_3, posture: [0, -1, 1, 0, 0, 0]}\n"
AXES = [*(f"arm.{name}" for name in JOINTS), "tool.x", "tool.y", "tool.z", "tool.rx", "tool.ry", "tool.rz"]
X, Y, Z = 6, 7, 8
FASTEST = 1.0  # rad/s, of a joint
HORIZON = 0.1  # s
JITTER = 0.15  # s between two messages, on a busy machine


@pytest.fixture
async def node(tmp_path: Path) -> AsyncIterator[RosRobot]:
    async with running_ros_robot(tmp_path) as robot:
        yield robot


@pytest.fixture
async def bridge(tmp_path: Path, node: RosRobot) -> AsyncIterator[RosBridge]:
    async with running_ros_bridge(tmp_path, node, written(tmp_path, TOOL, more="watchdog: 0.4\n")) as running:
        yield running


async def ready(link: RobotLink) -> Operator:
    driver = Operator(link)
    await driver.next(Feedback)
    async with asyncio.timeout(PATIENCE):
        await driver.heard(lambda feedback: feedback.faults == [] and feedback.unknown == [] and bool(feedback.goals))
    await driver.arm()
    return driver


def command(**goals: float) -> list[float | None]:
    return [goals.get(name.replace(".", "_")) for name in AXES]


async def lead(driver: Operator, number: int, goal: float) -> None:
    """Drive one axis of the tool until it is there, its goal to and fro by a little so that it does not settle."""
    step = 0
    async with asyncio.timeout(PATIENCE):
        while abs(driver.feedback.axes[number] - goal) > 3e-3:
            step += 1
            values: list[float | None] = [None] * len(AXES)
            values[number] = goal + 1e-4 * (step % 2)
            await driver.drive(values)


def assert_smooth(notes: list[dict[str, Any]]) -> None:
    """No joint was told to leap."""
    for before, after in itertools.pairwise(notes):
        for old, new in zip(before["positions"], after["positions"], strict=True):
            assert abs(new - old) <= FASTEST * (JITTER + HORIZON)


async def test_a_controller_of_positions_gets_the_numbers_of_the_places(tmp_path: Path, node: RosRobot) -> None:
    arm = (
        "  goals: true\n  command: {topic: /arm_velocity_controller/commands, message: Float64MultiArray, "
        "interface: position}\n"
    )
    rows = ROWS.replace("maximum: 1.0", "maximum: 1.0, lower: -3.0, upper: 0.3", 1)
    await node.tell("positions")
    path = written(tmp_path, arm, more="watchdog: 0.4\n", rows=rows)
    async with running_ros_bridge(tmp_path, node, path) as running:
        async with RobotLink(*running.address, "operator", name="test") as link:
            driver = await ready(link)
            begun, goal = list(driver.feedback.axes), 0.3  # the end of its range
            async with asyncio.timeout(PATIENCE):
                while abs(driver.feedback.axes[0] - goal) > 3e-3:
                    await driver.drive([goal, *[None] * (len(JOINTS) - 1)])
                await driver.heard(lambda feedback: feedback.at_rest)
        notes = await node.noted("positions", lambda notes: bool(notes) and notes[-1]["positions"][0] == goal)
    assert_smooth(notes)
    assert notes[-1]["positions"] == pytest.approx([goal, *begun[1:]], abs=1e-6)
    assert max(note["positions"][0] for note in notes) <= goal  # though they are ahead by the horizon
    assert not list(node.notes("trajectory"))


async def test_the_tool_goes_where_it_is_told_and_the_last_word_is_where_it_stays(
    bridge: RosBridge, node: RosRobot
) -> None:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = await ready(link)
        begun = driver.feedback.axes
        assert begun[9:] == pytest.approx([0.0, 0.0, 0.0], abs=1e-3)
        await lead(driver, Y, begun[Y] + 0.06)
        await driver.heard(lambda feedback: feedback.at_rest)
        assert driver.feedback.axes[X] == pytest.approx(begun[X], abs=0.01)
        assert driver.feedback.axes[Z] == pytest.approx(begun[Z], abs=0.01)
        goals = driver.feedback.goals[:6]
        notes = await node.noted("trajectory", lambda notes: notes[-1]["positions"] == pytest.approx(goals, abs=2e-3))
        for _ in range(5):  # a further word would come within two of the bridge's repeats
            await node.tell("tick")
        assert len(list(node.notes("trajectory"))) == len(notes)
    assert_smooth(notes)
    assert notes[0]["names"] == list(JOINTS)


def is_past(place: float, feedback: Feedback) -> bool:
    return feedback.axes[5] < place


async def test_a_saved_pose_is_gone_to_and_a_stick_and_a_stop_cancel_that(tmp_path: Path, node: RosRobot) -> None:
    near, far = "[0.1, -1, 1, 0, 0.2, 0.2]", "[0.1, -1, 1, 0, 0.2, -1.5]"
    path = written(tmp_path, TOOL + f"  poses: {{near: {near}, far: {far}}}\n", more="watchdog: 0.4\n")
    async with (
        running_ros_bridge(tmp_path, node, path) as running,
        RobotLink(*running.address, "operator", name="test") as link,
    ):
        driver = await ready(link)
        told = await send_to(driver, "near")
        assert told is not None
        assert (told.state, told.reason, told.text) == ("done", "", "pose near")
        assert driver.feedback.axes[:6] == pytest.approx([0.1, -1, 1, 0, 0.2, 0.2], abs=0.04)
        await driver.heard(lambda feedback: feedback.at_rest)
        for reason, place in (("driving", 0.0), ("stopped", -0.4)):
            begun = driver.feedback.axes[5]
            await send_to(driver, "far", until=partial(is_past, place))
            link.send(driver.command(command(arm_wrist_3_joint=begun)) if reason == "driving" else Stop(by="test"))
            told = await ended(driver)
            assert (told.state, told.reason) == ("cancelled", reason)
            await driver.heard(lambda feedback: feedback.at_rest)
            assert driver.feedback.axes[5] > -1.3
    assert_smooth(list(node.notes("trajectory")))


async def test_a_joint_goes_where_it_is_told_after_the_tool_and_a_stop_holds_it(
    bridge: RosBridge, node: RosRobot
) -> None:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = await ready(link)
        await lead(driver, Z, driver.feedback.axes[Z] - 0.04)
        await driver.heard(lambda feedback: feedback.at_rest)
        goal = (driver.feedback.goals[4] or 0.0) + 0.3
        async with asyncio.timeout(PATIENCE):
            while abs(driver.feedback.axes[4] - goal) > 0.01:
                await driver.drive(command(arm_wrist_2_joint=goal))
        await driver.drive(command(arm_wrist_2_joint=goal - 0.4))
        link.send(Stop(by="test"))
        async with asyncio.timeout(PATIENCE):
            await driver.heard(lambda feedback: feedback.stop.stopped and feedback.at_rest)
        held = driver.feedback.joints
        await driver.reset()
        await driver.arm()
        assert driver.feedback.joints == pytest.approx(held, abs=0.01)
    assert_smooth(list(node.notes("trajectory")))


async def test_an_arm_that_is_not_seen_is_held_and_moves_on_only_after_letting_go(
    bridge: RosBridge, node: RosRobot
) -> None:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        driver = await ready(link)
        far = command(arm_wrist_2_joint=0.45)
        await driver.drive(far)
        await node.noted("trajectory", lambda notes: len(notes) > 1)
        await node.tell("hush /joint_states")
        async with asyncio.timeout(PATIENCE):
            await driver.heard(lambda feedback: "arm.wrist_2_joint" in feedback.unknown)
        await node.tell("speak /joint_states")
        async with asyncio.timeout(PATIENCE):
            await driver.heard(lambda feedback: feedback.unknown == [] and feedback.at_rest)
        held = driver.feedback.joints[4]
        assert held < 0.44
        await driver.arm()
        assert driver.feedback.joints[4] == pytest.approx(held, abs=0.02)
    assert_smooth(list(node.notes("trajectory")))


async def test_a_bridge_to_ros_2_passes_the_cases_about_goals(bridge: RosBridge) -> None:
    async with RobotLink(*bridge.address, "operator", name="test") as link:
        await ready(link)
    subject = Subject(Place(*bridge.address), settle=PATIENCE)
    results = {}
    for case in CASES:
        if case.name.startswith("goal"):
            results[case.name] = await play(subject, case)
            await subject.clean_up()
    assert {name: result.detail for name, result in results.items() if result.outcome is Outcome.FAILED} == {}
