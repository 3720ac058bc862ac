"""A model with a tool as a robot: on the bridge, in MuJoCo."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
from tests.robot_bridge.bridge_helpers import PATIENCE, operator, running_bridge
from tests.robot_bridge.robots.mjcf.models import model_file
from tests.robot_bridge.robots.mjcf.tools.arms import SEVEN_JOINTS, SIX_JOINTS, arm_model


@pytest.fixture(params=[6, 7])
def arm(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[MjcfRobot]:
    robot = create(model_file(tmp_path, arm_model(SIX_JOINTS if request.param == 6 else SEVEN_JOINTS)))
    assert isinstance(robot, MjcfRobot)
    yield robot
    robot.close()


def test_the_description_is_whole_and_sticks_move_the_tool_and_the_joints(arm: MjcfRobot) -> None:
    description = arm.describe()
    check_description(description)
    bound = [{binding.axis for binding in layer.bindings} for layer in description.layers]
    assert {"grip.x", "grip.ry", "gripper"} <= bound[0]
    assert set.union(*bound) == {axis.name for axis in description.axes}
    assert len(arm.goals()) == len(arm.measured_axes()) == len(description.axes)


async def test_the_tool_goes_where_it_is_told_and_stops_move_nothing(arm: MjcfRobot) -> None:
    axes = [axis.name for axis in arm.describe().axes]
    z = axes.index("grip.z")
    still = [None if axis.kind == "goal" else 0.0 for axis in arm.describe().axes]
    async with running_bridge(arm) as bridge, operator(bridge) as driver:
        wanted = driver.feedback.axes[z] - 0.08
        while abs(driver.feedback.axes[z] - wanted) >= 5e-3:  # on a busy machine the watchdog rests it on its way
            for number in range(60):
                values: list[float | None] = [*still]
                values[z] = wanted + 1e-4 * (number % 2)
                await driver.drive(values)
            await driver.heard(lambda each: each.at_rest)
        assert driver.feedback.goals[z] == pytest.approx(wanted, abs=2e-3)
        arm.stop()
        held = arm.goals()
        arm.reset()
        await driver.drive(still)
        assert arm.goals() == pytest.approx(held, abs=1e-6)


async def test_the_bridges_of_arms_pass_the_cases_about_goals(arm: MjcfRobot) -> None:
    async with running_bridge(arm) as bridge:
        subject = Subject(Place(*bridge.address), settle=PATIENCE)
        results = {}
        for case in CASES:
            if case.name.startswith("goal") or case.name in ("executes", "hold", "rest", "lost_link"):
                results[case.name] = await play(subject, case)
                await subject.clean_up()
    skipped = {name for name, result in results.items() if result.outcome is Outcome.NOT_APPLICABLE}
    assert skipped == {"goal_wrap"}
    assert {name: result.detail for name, result in results.items() if result.outcome is Outcome.FAILED} == {}
