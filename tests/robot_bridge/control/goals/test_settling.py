"""A pose with `settling`: the robot may come nearer to its goals for that long after they stood still, within hold."""

import msgspec
import pytest

from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from tests.robot_bridge.goal_helpers import ARM_AXES, HangingArm

DT, HOLD, SETTLING = 0.004, 0.3, 0.12
REST: list[float | None] = [0.0, None, None, None, None, None]
ROUNDING = 1e-9


class Arm:
    """The shaper of a robot whose tool stops short of its goals by `short`."""

    def __init__(self, settling: float = SETTLING, short: float = 0.0) -> None:
        self.robot = HangingArm()
        self.short = short
        poses = [msgspec.structs.replace(pose, settling=settling) for pose in self.robot.describe().poses]
        self.shaper = AxisShaper(ARM_AXES, hold=HOLD, poses=poses, pursued=self.pursued)
        self.shaper.begin(self.robot.pursued, self.robot.pursued)
        self.now = 0.0
        self.driven_at = 0.0

    def pursued(self) -> list[float]:
        *others, x, z = self.robot.goals()
        return [*others, x - self.short, z]

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
    near: list[float | None] = [0.0, None, None, None, 0.7, None]
    arm.drive(2.0, near)
    assert arm.shaper.goals[4] == 0.7
    assert not arm.shaper.at_rest


def test_a_cut_leaves_nothing_to_settle() -> None:
    arm = Arm()
    arm.drive(0.4, X_FORWARD)
    before = arm.robot.applied[-1]
    arm.shaper.step(arm.now, DT)
    arm.shaper.take_back()
    arm.shaper.cut()
    assert arm.shaper.values == before
    assert arm.shaper.at_rest
