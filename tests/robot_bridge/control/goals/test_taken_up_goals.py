"""Goals at rest follow a robot that something else moves: what the robot itself pursues counts, no measurement."""

import asyncio
import math
from collections.abc import Sequence

import pytest

from lockstep.protocol.messages import Feedback
from tests.robot_bridge.bridge_helpers import PATIENCE, operator, running_bridge
from tests.robot_bridge.control.goals.goal_helpers import HangingArm
from tests.robot_bridge.control.goals.test_settling import DT, HOLD, X_FORWARD, Arm

NOTHING: list[float | None] = [0.0, None, None, None, None, None]
SHOULDER_UP: list[float | None] = [0.0, 1.0, None, None, None, None]


def moved_by_others(arm: Arm, way: float) -> None:
    """Something else leads the shoulder by a way, and the robot pursues that."""
    base, shoulder, elbow, turn, _, _ = arm.robot.pursued
    shoulder += way
    arm.robot.pursued = [base, shoulder, elbow, turn, shoulder + elbow, shoulder - elbow]


def test_at_rest_the_goals_are_where_the_robot_has_taken_itself_and_applying_them_moves_nothing() -> None:
    arm = Arm()
    arm.tick()
    moved_by_others(arm, 0.3)
    pursued = list(arm.robot.pursued)
    assert arm.shaper.take_up(arm.robot.goals())
    assert arm.shaper.goals == pytest.approx([None, *pursued[1:]])
    for _ in range(100):
        assert not arm.shaper.take_up(arm.robot.goals())
        arm.tick()
    assert arm.robot.pursued == pytest.approx(pursued)


def test_an_arm_that_had_fallen_is_not_taken_up_to_where_it_was_before_it_is_told_to_stay() -> None:
    arm = Arm()
    before = list(arm.robot.pursued)
    fallen = [0.0, -0.9, 0.4, 0.0, -0.5, -1.3]
    arm.shaper.begin(fallen, before)
    assert not arm.shaper.take_up(before)
    assert arm.shaper.goals == [None, *fallen[1:]]
    arm.tick()
    assert arm.shaper.take_up(before)  # from now on the robot knows better


def test_an_arm_that_hangs_below_its_goals_is_not_taken_up() -> None:
    arm = Arm()
    arm.robot.sag = 0.01
    goals = arm.shaper.goals
    for _ in range(100):
        assert not arm.shaper.take_up(arm.robot.goals())
        arm.tick()
    assert arm.shaper.goals == goals


def test_axes_that_are_driven_brake_or_are_told_where_they_stand_are_not_disturbed() -> None:
    arm = Arm()
    arm.drive(0.2, SHOULDER_UP)
    assert not arm.shaper.take_up([0.0] * 6)
    arm.shaper.rest()
    arm.tick()
    assert not arm.shaper.take_up([0.0] * 6)
    arm.drive(2.0, SHOULDER_UP)
    assert arm.shaper.goals[1] == 1.0
    assert not arm.shaper.take_up([0.0] * 6)
    arm.drive(DT, NOTHING)
    assert arm.shaper.take_up([0.0] * 6)


def test_a_goal_that_the_robot_does_not_know_stays() -> None:
    arm = Arm()
    goals = arm.shaper.goals
    for unknown in (math.nan, math.inf):
        assert not arm.shaper.take_up([unknown] * 6)
        assert arm.shaper.goals == goals
    arm.shaper.begin([math.nan] * 6, [math.nan] * 6)
    assert not arm.shaper.take_up([0.0] * 6)
    assert not arm.shaper.is_known


@pytest.mark.parametrize("cut", [False, True])
def test_the_values_of_a_pose_that_was_driven_do_not_change_or_the_robot_would_go_on_to_them(cut: bool) -> None:
    arm = Arm(short=0.02)
    arm.drive(0.4, X_FORWARD)
    if cut:
        arm.shaper.cut()
    else:
        while arm.now < arm.driven_at + 2 * HOLD:
            arm.tick()
    values = arm.shaper.values
    assert arm.shaper.at_rest
    assert not arm.shaper.take_up(arm.pursued())
    assert arm.tick() == values
    assert arm.shaper.goals[4] == pytest.approx(arm.pursued()[4])


def test_a_pose_and_its_joints_go_on_from_where_something_else_has_led_the_robot() -> None:
    arm = Arm()
    arm.drive(0.5, SHOULDER_UP)
    while not arm.shaper.at_rest:
        arm.tick()
    moved_by_others(arm, 0.2)
    pursued = list(arm.robot.pursued)
    assert arm.shaper.take_up(arm.robot.goals())
    assert arm.shaper.goals == pytest.approx([None, *pursued[1:]])
    here: list[float | None] = [0.0, None, None, None, pursued[4], pursued[5]]
    arm.drive(0.3, here)
    assert arm.robot.pursued == pytest.approx(pursued)


class Moved(HangingArm):
    """Others may lead its joints; it knows where."""

    def take_up(self) -> Sequence[float]:
        return self.goals()


async def test_a_bridge_feeds_back_where_others_have_led_the_robot_and_a_hand_moves_it_from_there() -> None:
    robot = Moved(sag=0.1)
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await driver.drive(NOTHING)
        robot.pursued = [0.0, 0.5, 0.4, 0.0, 0.9, 0.1]
        async with asyncio.timeout(PATIENCE):
            await driver.heard(lambda feedback: feedback.goals[1] == 0.5)
        assert driver.feedback.goals == pytest.approx([None, *robot.pursued[1:]])
        first = len(robot.applied)
        await driver.drive([0.0, 0.5, None, None, None, None])
        assert all(values[1] == 0.5 for values in robot.applied[first:])
        while driver.feedback.goals[1] != 0.51:
            await driver.drive([0.0, 0.51, None, None, None, None])
        assert all(0.5 <= values[1] <= 0.51 + 1e-9 for values in robot.applied[first:])
        assert robot.pursued[2:4] == pytest.approx([0.4, 0.0])


async def test_a_bridge_tells_at_once_where_a_motion_by_others_has_ended() -> None:
    robot = Moved()
    async with running_bridge(robot) as bridge, operator(bridge) as driver, asyncio.timeout(PATIENCE):
        began = driver.feedback.time
        for _ in range(10):
            goal = robot.pursued[1] + 0.05
            robot.pursued = [0.0, goal, 0.4, 0.0, goal + 0.4, goal - 0.4]
            while driver.feedback.goals[1] != goal:
                await driver.next(Feedback)
        assert driver.feedback.time - began < 2.5  # it is told every half second otherwise
