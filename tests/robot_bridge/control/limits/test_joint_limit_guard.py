import math
from collections.abc import Sequence

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.description import Axis, AxisGain, Joint, PositionLimit, RobotDescription
from lockstep.robot_bridge.control.limits.joint_limit_guard import JointLimitGuard
from lockstep.robot_bridge.control.limits.stopping_distance import share_of

TICK = 0.004
LATENCY = 0.01
NAMES = ("shoulder", "elbow")

AXES = (
    Axis(name="reach", label="Reach", unit="m/s", minimum=-1, maximum=1, slew=4, brake=8),
    Axis(name="lift", label="Lift", unit="m/s", minimum=-1, maximum=1, slew=1, brake=2),
)


def arm(**limits: tuple[float | None, float | None]) -> JointLimitGuard:
    """A guard of two axes, one limit for each joint: shoulder=(minimum, maximum)."""
    gains = tuple(AxisGain(axis=axis.name, gain=None) for axis in AXES)
    found = tuple(
        PositionLimit(
            name=f"{name} range",
            label=name,
            joint=name,
            minimum=minimum,
            maximum=maximum,
            axes=gains,
            margin=0.1,
            latency=LATENCY,
        )
        for name, (minimum, maximum) in limits.items()
    )
    description = RobotDescription(
        name="arm",
        label="Arm",
        axes=AXES,
        joints=tuple(Joint(name=name, unit="rad") for name in NAMES),
        position_limits=found,
    )
    return JointLimitGuard((0, 1), found, description, TICK)


def needed(offsets: Sequence[float], rate: float) -> float:
    """What the joint goes before the slower of the two axes is at rest, if it slows down with that."""
    return abs(rate) * (TICK + LATENCY + max(abs(offsets[0]) / 8, abs(offsets[1]) / 2) / 2)


def test_what_does_not_move_asks_for_nothing_wherever_the_joints_are() -> None:
    assert arm(shoulder=(-1, 1)).demands([0.0, 0.0], [math.nan, 5.0], None) == []


def test_a_joint_with_room_for_its_braking_distance_asks_for_nothing() -> None:
    assert arm(shoulder=(-1, 1)).demands([0.5, 0.5], [0.0, 0.0], [1.0, 0.0]) == []


def test_a_joint_beyond_its_limit_may_come_back_and_go_no_farther() -> None:
    guard = arm(shoulder=(-1, 1))
    assert guard.demands([0.5, 0.0], [0.95, 0.0], [-1.0, 0.0]) == []
    (demand,) = guard.demands([0.5, 0.0], [0.95, 0.0], [1.0, 0.0])
    assert (demand.limit, demand.axes, share_of(demand)) == ("shoulder range", (0,), 0.0)


def test_a_joint_that_stands_still_is_nobodys_concern_even_beyond_its_limit() -> None:
    assert arm(shoulder=(-1, 1)).demands([0.5, 0.0], [2.0, 0.0], [0.0, 1.0]) == []


def test_a_side_without_a_bound_is_free() -> None:
    assert arm(elbow=(0.0, None)).demands([1.0, 1.0], [0.0, 1e9], [0.0, 9.0]) == []


@pytest.mark.parametrize("position", [math.nan, math.inf, -math.inf])
def test_a_position_that_is_not_known_lets_nothing_move(position: float) -> None:
    (demand,) = arm(elbow=(-1, 1)).demands([0.5, 0.5], [0.0, position], [1.0, 1.0])
    assert demand.is_blind
    assert (demand.axes, share_of(demand)) == ((0, 1), 0.0)


@pytest.mark.parametrize("rates", [None, [], [1.0], [0.0, math.nan], [0.0, math.inf]], ids=str)
def test_a_rate_that_is_not_known_lets_nothing_move(rates: list[float] | None) -> None:
    (demand,) = arm(elbow=(-1, 1)).demands([0.0, 0.5], [0.0, 0.0], rates)
    assert demand.is_blind
    assert (demand.axes, share_of(demand)) == ((1,), 0.0)


def test_a_robot_that_tells_too_few_positions_does_not_move() -> None:
    (demand,) = arm(elbow=(-1, 1)).demands([0.5, 0.0], [0.0], [0.0, 1.0])
    assert demand.is_blind


SPEED = st.floats(-1, 1, allow_subnormal=False)
PLACE = st.floats(-2, 2, allow_subnormal=False)
RATE = st.floats(-5, 5, allow_subnormal=False)


@given(offsets=st.tuples(SPEED, SPEED), joints=st.tuples(PLACE, PLACE), rates=st.tuples(RATE, RATE))
def test_each_limit_asks_for_exactly_the_distance_that_its_joint_goes(
    offsets: tuple[float, float], joints: tuple[float, float], rates: tuple[float, float]
) -> None:
    demands = {each.limit: each for each in arm(shoulder=(-1, 1), elbow=(-0.5, 1.5)).demands(offsets, joints, rates)}
    for number, (name, minimum, maximum) in enumerate((("shoulder", -0.9, 0.9), ("elbow", -0.4, 1.4))):
        rate, place = rates[number], joints[number]
        room = maximum - place if rate > 0 else place - minimum
        far = needed(offsets, rate)
        if not any(offsets) or rate == 0 or far < room - 1e-9:
            assert f"{name} range" not in demands
        elif far > room + 1e-9:
            demand = demands[f"{name} range"]
            assert demand.linear + demand.square == pytest.approx(far)
            assert demand.room == pytest.approx(room)
            assert set(demand.axes) == {index for index, offset in enumerate(offsets) if offset}


def test_a_bound_of_a_limit_without_margin_or_latency_is_the_bound_itself() -> None:
    bare = msgspec.structs.replace(
        PositionLimit(name="bare", label="", joint="shoulder", minimum=None, maximum=1.0, axes=()), margin=0.0
    )
    description = RobotDescription(name="arm", label="Arm", axes=AXES, joints=(Joint(name="shoulder", unit="rad"),))
    (demand,) = JointLimitGuard((0,), (bare,), description, TICK).demands([1.0, 0.0], [1.0], [1.0])
    assert demand.room == 0.0
