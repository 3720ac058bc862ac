"""A pose with `settling`: the robot may come nearer to its goals for that long after they stood still, within hold."""

from collections.abc import Callable

import msgspec
import pytest

from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, HangingArm

DT, HOLD, SETTLING = 0.004, 0.3, 0.12
REST: list[float | None] = [0.0, None, None, None, None, None]
ROUNDING = 1e-9


class Arm:
    """The shaper of a robot whose tool stops short of its goals by `short`."""

    def __init__(self, settling: float = SETTLING, short: float = 0.0) -> None:
        self.robot = HangingArm()
        self.short = short
        self.limited: set[int] = set()  # axes that a limit keeps where they are
        poses = [msgspec.structs.replace(pose, settling=settling) for pose in self.robot.describe().poses]
        self.shaper = AxisShaper(ARM_AXES, hold=HOLD, limiter=self.limit, poses=poses, pursued=self.pursued)
        self.shaper.begin(self.robot.pursued, self.robot.pursued)
        self.now = 0.0
        self.driven_at = 0.0

    def pursued(self) -> list[float]:
        *others, x, z = self.robot.goals()
        return [*others, x - self.short, z]

    def limit(self, rates: list[float], _: Callable[[], list[float]]) -> list[float]:
        return [0.0 if number in self.limited else rate for number, rate in enumerate(rates)]

    def drive(self, seconds: float, values: list[float | None]) -> None:
        for _ in range(round(seconds / DT)):
            self.shaper.drive(values, self.now)
            self.driven_at = self.now
            self.tick()

    def tick(self) -> list[float]:
        values = self.shaper.step(self.now, DT)
        self.robot.apply(values)
        self.now += DT
        return values


X_FORWARD: list[float | None] = [0.0, None, None, None, 2.0, None]
NEAR: list[float | None] = [0.0, None, None, None, 0.7, None]  # the goal gets there within a second


def test_its_goals_stand_still_that_much_before_hold_has_passed_and_the_joints_goals_at_hold() -> None:
    for settling, values, axis in ((SETTLING, X_FORWARD, 4), (SETTLING, [0.0, 2.0, None, None, None, None], 1)):
        arm = Arm(settling)
        arm.drive(0.4, values)
        before, moved_at = arm.robot.applied[-1], arm.driven_at
        while arm.now < arm.driven_at + 2 * HOLD:
            began = arm.now
            if (after := arm.tick())[axis] != before[axis]:
                moved_at = began
            before = after
        least = HOLD - (settling if axis == 4 else 0.0)
        assert least - 0.15 < moved_at - arm.driven_at < least


def test_it_is_not_at_rest_before_it_has_settled() -> None:
    arm = Arm()
    arm.drive(0.4, X_FORWARD)
    arm.shaper.rest()
    values, stood = arm.tick(), 0
    while not arm.shaper.at_rest:
        before, values = values, arm.tick()
        stood = stood + 1 if values == before else 0
    assert stood * DT == pytest.approx(SETTLING, abs=2 * DT)


def test_the_joints_wait_until_the_tool_has_settled() -> None:
    arm = Arm()
    arm.drive(0.4, X_FORWARD)
    joints: list[float | None] = [0.0, 1.5, None, None, None, None]
    arm.drive(0.1 + SETTLING - 2 * DT, joints)  # it brakes in 0.1 s
    assert {values[1] for values in arm.robot.applied} == {arm.robot.applied[0][1]}
    arm.drive(4 * DT, joints)
    assert arm.robot.applied[-1][1] != arm.robot.applied[0][1]


def test_a_tool_that_stopped_short_of_its_goal_says_where_and_engaging_there_moves_nothing() -> None:
    arm = Arm(short=0.05)
    arm.drive(0.4, X_FORWARD)
    arm.drive(0.1 + SETTLING / 2, REST)
    applied = arm.robot.applied[-1][4]
    assert arm.shaper.goals[4] == applied
    assert not arm.shaper.take_settled()
    arm.drive(SETTLING, REST)
    assert arm.shaper.take_settled()
    assert not arm.shaper.take_settled()
    assert arm.shaper.goals[4] == pytest.approx(applied - 0.05)
    assert arm.robot.applied[-1][4] == applied  # the robot sees no change of its goals
    engaged = list(REST)
    engaged[4:] = arm.shaper.goals[4:]
    arm.short = 0.0
    arm.robot.pursued[4] = applied - 0.05
    arm.drive(0.2, engaged)
    assert arm.robot.applied[-1][4] == pytest.approx(applied - 0.05)


def test_a_tool_that_is_still_commanded_keeps_its_goal_though_it_has_settled() -> None:
    arm = Arm(short=0.05)
    arm.drive(2.0, NEAR)
    assert arm.shaper.goals[4] == 0.7
    assert not arm.shaper.at_rest


def test_a_pose_is_pursued_while_a_command_drives_it_until_it_must_settle_within_hold() -> None:
    arm = Arm()
    assert not arm.shaper.pursued_poses
    arm.drive(DT, [0.0, None, None, None, 0.6, None])  # where it is
    assert arm.shaper.pursued_poses == ["tool"]
    pursued_at = arm.driven_at
    while arm.now < arm.driven_at + 2 * HOLD:
        began = arm.now
        arm.tick()
        if arm.shaper.pursued_poses:
            pursued_at = began
    assert HOLD - SETTLING - 2 * DT < pursued_at - arm.driven_at <= HOLD - SETTLING


def test_a_pose_without_settling_and_one_that_is_not_driven_are_not_pursued() -> None:
    arm = Arm(settling=0.0)
    arm.drive(DT, X_FORWARD)
    assert not arm.shaper.pursued_poses
    arm = Arm()
    undriven: list[list[float | None]] = [
        REST,
        [0.0, 2.0, None, None, None, None],
        [0.5, None, None, 1.0, None, None],
    ]
    for values in undriven:
        arm.drive(DT, values)
        assert not arm.shaper.pursued_poses
    arm.shaper.drive(X_FORWARD, arm.now, 0.0)
    arm.tick()
    assert not arm.shaper.pursued_poses


def neutral(arm: Arm) -> None:
    arm.drive(DT, REST)


def rest(arm: Arm) -> None:
    arm.shaper.rest()
    arm.tick()


def fail(arm: Arm) -> None:
    arm.shaper.brake(DT)


@pytest.mark.parametrize("end", [neutral, rest, fail])
def test_whatever_ends_the_driving_the_pursuit_ends_at_once_and_the_pose_settles_from_then_on(
    end: Callable[[Arm], None],
) -> None:
    arm = Arm()
    arm.drive(1.0, NEAR)
    assert arm.shaper.pursued_poses
    end(arm)
    assert not arm.shaper.pursued_poses
    ticks = 1
    while not arm.shaper.at_rest:
        end(arm)
        ticks += 1
    assert ticks * DT == pytest.approx(SETTLING, abs=2 * DT)


def test_the_joints_wait_for_a_tool_that_was_pursued_until_now() -> None:
    arm = Arm()
    arm.drive(1.0, NEAR)
    joints: list[float | None] = [0.0, 1.5, None, None, None, None]
    before = arm.robot.applied[-1][1]
    arm.drive(SETTLING - 2 * DT, joints)
    assert arm.robot.applied[-1][1] == before
    arm.drive(4 * DT, joints)
    assert arm.robot.applied[-1][1] != before


def test_a_pose_that_a_limit_keeps_from_its_goal_is_not_pursued() -> None:
    arm = Arm()
    arm.limited = {4}
    arm.drive(DT, X_FORWARD)
    assert not arm.shaper.pursued_poses
    arm.limited = {0, 1}  # others
    arm.drive(DT, X_FORWARD)
    assert arm.shaper.pursued_poses


def test_a_cut_leaves_nothing_to_settle_and_pursues_nothing() -> None:
    arm = Arm()
    arm.drive(0.4, X_FORWARD)
    before = arm.robot.applied[-1]
    arm.shaper.step(arm.now, DT)
    arm.shaper.take_back()
    arm.shaper.cut()
    assert arm.shaper.values == before
    assert arm.shaper.at_rest
    assert not arm.shaper.pursued_poses
