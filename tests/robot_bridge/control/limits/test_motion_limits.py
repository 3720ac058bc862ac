import math
from itertools import cycle

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.protocol.description import AxisGain
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.motion_limits import MotionLimits
from lockstep.robot_bridge.control.ticks.ticker import Ticker
from tests.robot_bridge.control.limits.limits_helpers import (
    DT,
    HOLD,
    LIFT,
    ExactBase,
    ExactLift,
    base_description,
    inside,
)

SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
ROOM = [(-3.0, -2.0), (3.0, -2.0), (3.0, 2.0), (-3.0, 2.0)]
L_SHAPE = [(-3.0, -3.0), (3.0, -3.0), (3.0, 0.0), (0.0, 0.0), (0.0, 3.0), (-3.0, 3.0)]

share = st.floats(-1.0, 1.0, allow_nan=False)
drives = st.lists(st.tuples(share, share, share, st.integers(1, 120)), min_size=1, max_size=12)


@settings(max_examples=60, deadline=None)
@given(start=st.floats(0.0, 1.0), commands=st.lists(st.tuples(share, share, st.integers(1, 150)), max_size=12))
def test_no_command_brings_a_measured_joint_past_its_limits(
    start: float, commands: list[tuple[float, float, int]]
) -> None:
    lift = ExactLift(start)
    for coarse, fine, ticks in commands:
        for _ in range(ticks):
            lift.drive([coarse, fine * 0.1], 1)
            assert -1e-9 <= lift.height <= 1 + 1e-9


@settings(max_examples=60, deadline=None)
@given(
    start=st.floats(0.0, 1.0),
    commands=st.lists(st.tuples(share, share, st.integers(1, 150)), max_size=12),
    early=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20),
)
def test_a_robot_that_holds_its_values_until_the_next_tick_stays_within_limits_also_where_ticks_come_early(
    start: float, commands: list[tuple[float, float, int]], early: list[float]
) -> None:
    lift = ExactLift(start)
    lift.limits = MotionLimits(LIFT, lift, DT, longest_tick=2 * DT)
    lift.shaper = AxisShaper(LIFT.axes, hold=HOLD, limiter=lift.limits)
    metronome, now, shares = Ticker(DT, 0.0), 0.0, cycle(early)
    values = [0.0, 0.0]
    for coarse, fine, ticks in commands:
        for _ in range(ticks):
            latest, soonest = metronome.wait(now), metronome.early(now)
            held = soonest + next(shares) * (latest - soonest)  # s from this tick to the next
            lift.place[0] += (-0.5 * values[0] + values[1]) * held
            assert -1e-9 <= lift.height <= 1 + 1e-9
            now += held
            lift.shaper.drive([coarse, fine * 0.1], now)
            values = lift.shaper.step(now, DT)


@settings(max_examples=80, deadline=None)
@given(commands=drives, zones=st.sampled_from(["room", "pillar", "corner"]), radius=st.sampled_from([0.0, 0.3]))
def test_no_command_brings_the_base_across_a_geofence(
    commands: list[tuple[float, float, float, int]], zones: str, radius: float
) -> None:
    fences = {
        "room": (("keep_in", ROOM), ("keep_out", [(x + 1.5, y) for x, y in SQUARE])),
        "pillar": (("keep_out", [(0.6, -0.2), (1.2, 0.1), (0.7, 0.9)]),),
        "corner": (("keep_in", L_SHAPE),),
    }[zones]
    base = ExactBase(base_description(*fences, radius=radius), [-1.0, -1.0, 0.0])
    for vx, vy, wz, ticks in commands:
        for _ in range(ticks):
            base.drive([vx, vy, 2 * wz], 1)
            for kind, corners in fences:
                assert clearance(corners, *base.place[:2]) >= radius - 1e-9
                assert inside(corners, *base.place[:2]) == (kind == "keep_in")


def clearance(corners: list[tuple[float, float]], x: float, y: float) -> float:
    """Distance from the nearest edge."""
    found = math.inf
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        dx, dy = bx - ax, by - ay
        along = min(max(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
        found = min(found, math.hypot(ax + along * dx - x, ay + along * dy - y))
    return found


def test_an_axis_that_runs_into_its_limit_stops_at_it_and_the_limit_is_named() -> None:
    lift = ExactLift(0.5)
    lift.drive([-1.0, 0.0], 600)
    assert lift.height == pytest.approx(1.0, abs=0.001)
    assert lift.limits.acting == {"height.range"}
    assert abs(lift.values[0]) < 0.01


def test_motion_away_from_a_limit_is_free_also_from_beyond_it() -> None:
    lift = ExactLift(1.2)
    lift.drive([1.0, 0.0], 1)
    assert lift.values[0] == pytest.approx(4 * DT)  # as the slew has it
    assert lift.limits.acting == frozenset()


def test_beyond_a_limit_nothing_leads_farther() -> None:
    lift = ExactLift(1.2)
    lift.drive([-1.0, 0.1], 100)
    assert lift.height == 1.2


def test_of_two_axes_only_the_one_that_leads_to_the_limit_is_slowed() -> None:
    lift = ExactLift(1.0)
    lift.drive([0.4, 0.1], 1)
    assert lift.values == [pytest.approx(4 * DT), 0.0]


def test_an_unknown_position_means_no_motion() -> None:
    lift = ExactLift(0.5)
    lift.known = False
    lift.drive([1.0, 0.1], 50)
    assert lift.values == [0.0, 0.0]
    assert lift.limits.blind == {"height.range"}


@settings(max_examples=60, deadline=None)
@given(spells=st.lists(st.tuples(st.booleans(), share, st.integers(1, 40)), min_size=1, max_size=12))
def test_while_a_position_is_unknown_nothing_speeds_up_and_who_wants_to_move_finds_the_limit_blind(
    spells: list[tuple[bool, float, int]],
) -> None:
    lift = ExactLift(0.5)
    for known, coarse, ticks in spells:
        lift.known = known
        for _ in range(ticks):
            before = abs(lift.values[0])
            lift.drive([coarse, 0.0], 1)
            if known:
                assert not lift.limits.blind
            else:
                assert abs(lift.values[0]) <= before
                assert lift.limits.blind or lift.values[0] == 0.0
                if before == 0.0:
                    assert bool(lift.limits.blind) == (coarse != 0.0)


def test_a_position_that_gets_lost_while_moving_brings_the_axes_to_rest_at_their_brake() -> None:
    lift = ExactLift(0.5)
    lift.drive([1.0, 0.0], 100)
    lift.known = False
    lift.drive([1.0, 0.0], 10)
    assert lift.values[0] == pytest.approx(1.0 - 10 * 8 * DT)
    lift.drive([1.0, 0.0], 50)
    assert lift.values == [0.0, 0.0]


def test_a_limit_that_jumps_nearer_is_met_with_the_brake_and_not_with_a_step() -> None:
    lift = ExactLift(0.5)
    lift.drive([-1.0, 0.0], 60)
    lift.place[0] = 1.5  # measured anew
    lift.drive([-1.0, 0.0], 1)  # ExactLift itself checks the ramp
    lift.drive([-1.0, 0.0], 50)
    assert lift.values[0] == 0.0


def test_a_push_against_a_limit_counts_as_one_spell_and_ends_with_it() -> None:
    lift = ExactLift(1.0)
    lift.drive([-0.2, 0.0], 10)
    lift.drive([0.2, 0.0], 10)
    assert lift.limits.acting == {"height.range"}
    lift.drive([0.2, 0.0], 60)
    assert lift.limits.acting == frozenset()
    lift.drive([-1.0, 0.0], 400)
    lift.drive([0.0, 0.0], 1)
    assert lift.limits.acting == frozenset()


def test_with_gains_by_posture_the_robot_says_what_the_axes_do_and_silence_means_no_motion() -> None:
    limit = msgspec.structs.replace(LIFT.position_limits[0], axes=(AxisGain(axis="coarse", gain=None),))
    description = msgspec.structs.replace(LIFT, position_limits=(limit,))

    class Postured(ExactLift):
        def joint_rates(self, values: object) -> list[float]:
            return [-0.5 * values[0]]  # type: ignore[index]

    lift = Postured(0.5, description)
    lift.drive([-1.0, 0.0], 600)
    assert 0.99 <= lift.height <= 1.0
    lift.drive([1.0, 0.0], 1)
    assert lift.values[0] > 0

    silent = ExactLift(0.5, description)
    silent.drive([1.0, 0.0], 20)
    assert silent.values == [0.0, 0.0]


def test_a_base_slides_along_a_fence_with_the_axis_that_leads_along_it() -> None:
    base = ExactBase(base_description(("keep_in", ROOM)), [2.9, 0.0, 0.0])
    base.drive([0.5, 0.3, 0.0], 300)
    assert base.place[0] == pytest.approx(3.0, abs=0.002)
    assert base.place[1] == pytest.approx(0.35, abs=0.02)
    assert base.limits.acting == {"zone 0"}


def test_a_base_that_is_outside_its_zone_may_come_back_and_go_no_farther() -> None:
    base = ExactBase(base_description(("keep_in", ROOM)), [4.0, 0.0, 0.0])
    base.drive([0.5, 0.0, 0.0], 100)
    assert base.place[0] == 4.0
    base.drive([-0.5, 0.0, 0.0], 1000)
    assert base.place[0] == pytest.approx(4.0 - 1.97, abs=0.1)


def test_a_base_found_in_a_forbidden_zone_may_leave_it() -> None:
    base = ExactBase(base_description(("keep_out", SQUARE)), [0.8, 0.0, 0.0])
    base.drive([-0.5, 0.0, 0.0], 100)
    assert base.place[0] == 0.8
    base.drive([0.5, 0.0, 0.0], 300)
    assert base.place[0] > 1.2


def test_turning_on_the_spot_is_free_even_at_a_fence() -> None:
    base = ExactBase(base_description(("keep_in", ROOM), radius=0.3), [2.7, 0.0, 0.0])
    base.drive([0.0, 0.0, 2.0], 300)
    assert base.values[2] == 2.0
    assert base.limits.acting == frozenset()


@pytest.mark.parametrize("lost", [0, 1])
def test_a_base_that_does_not_know_where_it_is_does_not_move_but_may_turn(lost: int) -> None:
    base = ExactBase(base_description(("keep_out", SQUARE)), [-3.0, -3.0, 0.0])
    base.place[lost] = math.nan
    base.drive([1.0, 1.0, 1.0], 50)
    assert base.values == [0.0, 0.0, pytest.approx(1.0)]
    assert base.limits.blind == {"zone 0"}


def test_a_base_that_does_not_know_its_heading_moves_only_far_from_every_fence() -> None:
    base = ExactBase(base_description(("keep_out", SQUARE)), [-3.0, 0.0, math.nan])
    base.limits([0.5, 0.0, 0.0], lambda: [0.0, 0.0, 0.0])
    assert base.limits.acting == frozenset()
    base.place[0] = -1.001
    assert base.limits([0.5, 0.0, 0.0], lambda: [0.0, 0.0, 0.0])[0] < 0.2
    assert base.limits([-0.5, 0.0, 0.0], lambda: [0.0, 0.0, 0.0])[0] > -0.2


def test_a_pose_with_too_few_numbers_counts_as_unknown() -> None:
    base = ExactBase(base_description(("keep_out", SQUARE)), [-3.0, 0.0, 0.0])
    base.place = []
    assert base.limits([0.01, 0.0, 0.0], lambda: [0.0, 0.0, 0.0]) == [0.0, 0.0, 0.0]


def test_a_robot_without_limits_is_left_alone() -> None:
    description = msgspec.structs.replace(LIFT, position_limits=())
    values = [9.0, 9.0]
    assert MotionLimits(description, ExactLift(0.0), DT)(values, lambda: [0.0, 0.0]) is values
