"""A pose and the axes that it stands in for take turns: what one has moved, the other goes on from."""

import math

import pytest

from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, HangingArm

DT = 0.004
REST: list[float | None] = [0.0, None, None, None, None, None]


class Arm:
    """The shaper and the arm that it drives, tick by tick."""

    def __init__(self, sag: float = 0.0) -> None:
        self.robot = HangingArm(sag)
        self.shaper = AxisShaper(
            ARM_AXES, hold=0.3, poses=self.robot.describe().poses, pursued=lambda: self.robot.goals()
        )
        self.shaper.begin(self.robot.pursued, self.robot.pursued)
        self.now = 0.0

    def drive(self, seconds: float, **goals: float) -> list[float]:
        """Command the same at every tick; return the robot's goals at the end."""
        names = [axis.name for axis in ARM_AXES]
        values = list(REST)
        for name, goal in goals.items():
            values[names.index(name)] = goal
        for _ in range(round(seconds / DT)):
            self.shaper.drive(values, self.now)
            self.tick()
        return self.robot.pursued

    def tick(self, seconds: float = DT) -> None:
        for _ in range(round(seconds / DT)):
            before = self.robot.pursued
            self.robot.apply(self.shaper.step(self.now, DT))
            self.now += DT
            for axis, old, new in zip(ARM_AXES[1:4], before[1:4], self.robot.pursued[1:4], strict=True):
                assert abs(new - old) <= 2 * axis.slew * DT, "a joint jumps"


def test_a_pose_goes_on_from_where_the_joints_have_brought_it_and_the_joints_from_where_the_pose_has() -> None:
    arm = Arm()
    assert arm.drive(1.0, shoulder=0.5, elbow=0.5)[4:] == pytest.approx([1.0, 0.0])
    assert arm.shaper.goals[4:] == pytest.approx([1.0, 0.0])
    assert arm.drive(1.0, x=1.0)[1:3] == pytest.approx([0.5, 0.5])
    assert arm.drive(1.0, x=1.4)[1:3] == pytest.approx([0.7, 0.7])
    assert arm.shaper.goals[1:3] == pytest.approx([0.7, 0.7])
    assert arm.drive(1.0, elbow=0.7)[4:] == pytest.approx([1.4, 0.0])


def test_the_values_of_the_set_that_is_not_driven_do_not_change() -> None:
    arm = Arm()
    arm.drive(0.5, shoulder=0.5, turn=0.3)
    assert {(values[4], values[5]) for values in arm.robot.applied} == {(0.6, -0.2)}
    first = len(arm.robot.applied)
    arm.drive(0.5, x=0.8, turn=0.0)
    later = arm.robot.applied[first:]
    assert {(values[1], values[2]) for values in later} == {(0.5, 0.4)}
    assert [values[5] for values in later] == pytest.approx([0.1] * len(later))  # read anew with x, and not driven


def test_a_pose_waits_until_the_joints_stand_still() -> None:
    arm = Arm()
    arm.drive(0.3, shoulder=0.6)
    moving = arm.robot.pursued[1]
    arm.drive(DT, x=0.0)
    assert arm.robot.pursued[1] > moving  # it brakes
    arm.drive(0.5, x=0.0)
    assert arm.robot.pursued[4] < 0.9
    arm.drive(2.0, x=0.0)
    assert arm.robot.pursued[4] == 0.0


def test_a_pose_whose_place_the_robot_does_not_know_waits() -> None:
    arm = Arm()
    arm.drive(0.5, shoulder=0.4)
    pursued, arm.robot.pursued = arm.robot.pursued, [math.nan] * 6
    assert arm.shaper.goals[4:] == [None, None]
    arm.robot.pursued = [*pursued[:4], math.nan, pursued[5]]
    before = list(arm.robot.applied[-1])
    arm.shaper.drive([*REST[:4], 0.9, None], arm.now)
    assert arm.shaper.step(arm.now, DT) == before
    arm.robot.pursued = pursued
    arm.drive(1.0, x=0.9)
    assert arm.robot.pursued[4] == 0.9


def test_changing_sets_a_hundred_times_moves_nothing_even_with_a_load() -> None:
    arm = Arm(sag=0.1)
    arm.drive(0.5, shoulder=0.4)
    stood = arm.robot.pursued
    for _ in range(100):
        for names in ((1, 2), (4, 5)):
            goals = arm.shaper.goals
            arm.shaper.drive([goals[number] if number in names else REST[number] for number in range(6)], arm.now)
            arm.tick(0.02)
            arm.shaper.rest()
            arm.tick(0.02)
    assert arm.robot.pursued == pytest.approx(stood, abs=1e-12)
