"""The mobile manipulator whose arm is driven by goals, on the bridge, in MuJoCo."""

import asyncio
from collections.abc import Iterator, Mapping

import pytest

from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.mobile_manipulator.goal_driven import create
from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator
from tests.robot_bridge.bridge_helpers import Operator, operator, running_bridge

PATIENCE = 60.0  # s, on a busy machine


@pytest.fixture
def robot() -> Iterator[MobileManipulator]:
    made = create()
    assert isinstance(made, MobileManipulator)
    yield made
    made.close()


def names(robot: MobileManipulator) -> list[str]:
    return [axis.name for axis in robot.describe().axes]


def command(robot: MobileManipulator, goals: Mapping[str, float]) -> list[float | None]:
    return [goals.get(axis.name, None if axis.kind == "goal" else 0.0) for axis in robot.describe().axes]


async def lead(driver: Operator, robot: MobileManipulator, name: str, goal: float, **rates: float) -> None:
    """Drive an axis of the tool until it is there, its goal to and fro by a little so that it does not settle."""
    number, step = names(robot).index(name), 0
    moving = {axis.replace("_", "."): rate for axis, rate in rates.items()}
    async with asyncio.timeout(PATIENCE):
        while abs(driver.feedback.axes[number] - goal) > 5e-3:
            step += 1
            await driver.drive(command(robot, {name: goal + 1e-4 * (step % 2), **moving}))


def test_its_base_has_rates_and_its_arm_has_goals_or_a_pose_against_its_mount(robot: MobileManipulator) -> None:
    description = robot.describe()
    check_description(description)
    assert [axis.kind for axis in description.axes] == ["rate"] * 3 + ["goal"] * 12
    (pose,) = description.poses
    assert pose.frame == "mount"
    assert pose.instead_of == tuple(names(robot)[3:9])
    bound = {binding.axis for layer in description.layers for binding in layer.bindings}
    assert bound == set(names(robot))
    assert robot.measured_axes()[3:] == pytest.approx(robot.goals()[3:], abs=0.02)


async def test_the_tool_goes_where_it_is_told_against_the_base_also_while_that_drives(robot: MobileManipulator) -> None:
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        begun = driver.feedback.axes
        z = names(robot).index("tool.z")
        await lead(driver, robot, "tool.z", begun[z] - 0.1, base_wz=0.5)
        async with asyncio.timeout(PATIENCE):
            await driver.heard(lambda feedback: feedback.at_rest)
        assert driver.feedback.joints[2] > 0.05  # the base has turned, and the tool with it
        assert driver.feedback.axes[z - 2 : z] == pytest.approx(begun[z - 2 : z], abs=0.02)
        assert driver.feedback.axes[z] == pytest.approx(driver.feedback.goals[z], abs=0.02)


async def test_a_stop_holds_the_arm_and_the_reset_moves_nothing(robot: MobileManipulator) -> None:
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        begun = driver.feedback.goals[names(robot).index("arm.elbow")]
        assert begun is not None
        async with asyncio.timeout(PATIENCE):
            for _ in range(10):
                await driver.drive(command(robot, {"arm.elbow": begun + 0.4}))
        robot.stop()
        held = robot.goals()
        robot.reset()
        await driver.drive(command(robot, {}))
        assert robot.goals()[3:9] == pytest.approx(held[3:9], abs=0.02)


async def test_its_bridge_passes_the_cases_about_goals(robot: MobileManipulator) -> None:
    async with running_bridge(robot) as bridge:
        subject = Subject(Place(*bridge.address), settle=PATIENCE)
        results = {}
        for case in CASES:
            if case.name.startswith("goal") or case.name in ("executes", "hold", "rest"):
                results[case.name] = await play(subject, case)
                await subject.clean_up()
    assert {name: result.detail for name, result in results.items() if result.outcome is Outcome.FAILED} == {}
