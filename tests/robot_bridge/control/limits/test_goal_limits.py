"""Position limits slow the goal of a goal axis as they slow a rate axis; two poses of one arm exclude each other."""

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.protocol.description import AxisGain, Joint, Pose, PositionLimit, RobotDescription
from lockstep.robot_bridge.control.goals.command_values import CommandValues
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.motion_limits import MotionLimits
from lockstep.robot_bridge.description.check_description import check_description
from tests.robot_bridge.control.goals.goal_helpers import ARM_AXES, SHOULDER, HangingArm

DT = 0.004
CRANE = RobotDescription(
    name="crane",
    label="Crane",
    axes=(msgspec.structs.replace(SHOULDER, rest=0.7),),  # which has no meaning
    joints=(Joint(name="hook", unit="m"),),
    position_limits=(
        PositionLimit(
            name="hook.range",
            label="Hook",
            joint="hook",
            minimum=-1.0,
            maximum=1.0,
            axes=(AxisGain(axis="shoulder", gain=2.0),),
        ),
    ),
)


class Crane:
    """Its hook is at twice the shoulder's goal, exactly."""

    def __init__(self) -> None:
        check_description(CRANE)
        self.limits = MotionLimits(CRANE, self, DT)
        self.shaper = AxisShaper(CRANE.axes, hold=0.3, limiter=self.limits)
        self.shaper.begin([0.0], [0.0])
        self.now = 0.0
        self.known = True

    def positions(self) -> list[float]:
        return [2.0 * self.shaper.values[0] if self.known else float("nan")]

    def joint_rates(self, values: object) -> None:
        return None

    def drive(self, goal: float | None, seconds: float) -> float:
        for _ in range(round(seconds / DT)):
            self.shaper.drive([goal], self.now)
            self.shaper.step(self.now, DT)
            self.now += DT
        return self.shaper.values[0]


def test_the_goal_stops_at_a_position_limit_and_motion_away_is_free() -> None:
    crane = Crane()
    assert crane.drive(1.5, 3.0) == pytest.approx(0.5, abs=0.01)
    assert crane.positions()[0] <= 1.0
    assert crane.limits.acting == {"hook.range"}
    assert crane.drive(-0.2, 3.0) == -0.2


def test_where_the_position_is_not_known_the_goal_brakes() -> None:
    crane = Crane()
    was = crane.drive(0.4, 0.2)
    crane.known = False
    stood = crane.drive(0.4, 0.3)
    assert was < stood < 0.4
    assert crane.limits.blind == {"hook.range"}
    assert crane.drive(0.4, 0.3) == stood


@settings(deadline=None)
@given(st.lists(st.tuples(st.none() | st.floats(-3, 3), st.floats(0.01, 0.5)), max_size=15))
def test_whatever_is_commanded_the_hook_stays_within_its_limit(commands: list[tuple[float | None, float]]) -> None:
    crane = Crane()
    for goal, seconds in commands:
        crane.drive(goal, seconds)
        assert -1.0 - 1e-9 <= crane.positions()[0] <= 1.0 + 1e-9


def test_two_poses_that_stand_in_for_the_same_axes_conflict() -> None:
    tool = HangingArm().describe().poses[0]
    eye = Pose(name="eye", label="", body="tool", position=("turn2", "", ""), instead_of=("elbow",))
    axes = (*ARM_AXES, msgspec.structs.replace(SHOULDER, name="turn2"))
    values = CommandValues(axes, poses=(tool, eye))
    stay = [0.0, None, None, None]
    refused = values.misfit([*stay, 0.6, None, 0.1])
    assert refused is not None
    assert refused[0] == "conflict"
    assert values.misfit([0.0, 0.2, None, None, None, None, 0.1]) is None  # the shoulder is no part of the eye's axes
