"""The applied goal of an axis: how it gets to the commanded one, comes to rest, and what it never does."""

import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.goal_axis import shorter_way, stopping_speed
from tests.robot_bridge.control.goals import goal_helpers

HOLD = 0.3
DT = 0.004
ROUNDING = 1e-9
SHOULDER = msgspec.structs.replace(goal_helpers.SHOULDER, brake=8, acceleration=3, reach=1.0)
WHEEL = msgspec.structs.replace(SHOULDER, minimum=-math.pi, maximum=math.pi, wrap=2 * math.pi)


class Player:
    """A shaper of one goal axis, tick by tick; `rates` and `goals` have one entry a tick."""

    def __init__(self, axis: Axis = SHOULDER, place: float = 0.0, hold: float = HOLD) -> None:
        self.shaper = AxisShaper([axis], hold=hold)
        self.shaper.begin([place], [place])
        self.now = 0.0
        self.goals = [place]

    @property
    def goal(self) -> float:
        return self.shaper.values[0]

    @property
    def rates(self) -> list[float]:
        return [(after - before) / DT for before, after in zip(self.goals, self.goals[1:], strict=False)]

    def drive(self, goal: float | None, seconds: float, speed: float = 1.0) -> None:
        """Command the same at every tick."""
        for _ in range(round(seconds / DT)):
            self.shaper.drive([goal], self.now, speed)
            self.tick()

    def tick(self, seconds: float = 0.0) -> None:
        for _ in range(max(1, round(seconds / DT))):
            self.goals += self.shaper.step(self.now, DT)
            self.now += DT


def test_a_goal_is_reached_exactly_with_bounded_speed_and_acceleration_and_without_overshooting() -> None:
    player = Player()
    player.drive(1.2, 2.0)
    assert player.goal == 1.2
    assert max(player.rates) == pytest.approx(SHOULDER.slew)
    assert max(player.goals) == 1.2
    steps = [after - before for before, after in zip([0.0, *player.rates], player.rates, strict=False)]
    assert max(map(abs, steps)) == pytest.approx(SHOULDER.acceleration * DT)


def test_without_an_acceleration_of_its_own_the_brake_is_used() -> None:
    player = Player(msgspec.structs.replace(SHOULDER, acceleration=0))
    player.drive(1.0, DT)
    assert player.rates == pytest.approx([8 * DT])


def test_speed_bounds_the_speed_and_0_keeps_the_axis_where_it_is() -> None:
    player = Player()
    player.drive(1.0, 0.4, speed=0.25)
    assert max(player.rates) == pytest.approx(0.25 * SHOULDER.slew)
    player.drive(1.0, 1.0, speed=0)
    stood = player.goal
    assert 0 < stood < 0.3
    player.drive(1.0, 1.0, speed=0)
    assert player.goal == stood
    assert not player.shaper.at_rest  # it is commanded to go on


def test_a_goal_that_comes_nearer_or_turns_round_is_braked_for() -> None:
    player = Player()
    player.drive(1.8, 0.7)
    was = player.goal
    player.drive(was - 0.5, 2.0)
    assert player.goal == was - 0.5
    assert max(player.goals) < was + 1.5 * SHOULDER.slew**2 / (2 * SHOULDER.brake)
    assert min(player.goals[200:]) >= was - 0.5


def test_null_brakes_at_the_brake_rate_and_stays() -> None:
    player = Player()
    player.drive(1.8, 0.7)
    was = player.goal
    player.drive(None, 0.5)
    stood = player.goal
    assert stood - was == pytest.approx(SHOULDER.slew**2 / (2 * SHOULDER.brake), rel=0.1)
    player.drive(None, 0.5)
    assert player.goal == stood
    assert player.shaper.at_rest


def test_a_goal_stands_still_when_hold_has_passed_since_the_last_command() -> None:
    player = Player()
    player.drive(1.8, 0.7)
    deadline = player.now - DT + HOLD
    while player.now < deadline:
        player.tick()
    stood = player.goal
    player.tick(0.3)
    assert player.goal == stood
    assert player.shaper.at_rest


def test_rest_brakes_at_once_and_engaging_again_at_the_applied_goal_moves_nothing() -> None:
    player = Player()
    player.drive(1.0, 0.3)
    player.shaper.rest()
    player.tick(0.3)
    stood = player.goal
    for _ in range(50):
        player.drive(player.goal, 0.02)
        player.shaper.rest()
        player.tick(0.02)
    assert player.goal == stood


def test_a_cut_stands_still_at_once_where_the_goal_is() -> None:
    player = Player()
    player.drive(1.0, 0.3)
    was = player.goal
    player.shaper.cut()
    assert player.shaper.at_rest
    player.tick(0.1)
    assert player.goal == was


def test_goals_are_clamped_to_the_limits() -> None:
    player = Player()
    player.drive(9.0, 4.0)
    assert player.goal == 2.0
    player.drive(-1e308, 4.0)
    assert player.goal == -2.0


def test_released_near_a_limit_a_weak_brake_is_enough() -> None:
    weak = msgspec.structs.replace(SHOULDER, brake=5.0, acceleration=50.0)
    player = Player(weak)
    while player.goal < 1.9:
        player.drive(9.0, DT)
    player.shaper.rest()
    player.tick(1.0)
    assert 1.9 < player.goal <= 2.0


def test_an_axis_outside_of_its_limits_may_only_move_back() -> None:
    player = Player(place=2.5)
    player.drive(2.7, 0.2)
    assert player.goal == 2.5
    player.drive(2.2, 2.0)
    assert player.goal == 2.2
    player.drive(2.4, 1.0)
    assert player.goal == 2.2
    player.drive(1.5, 2.0)
    player.drive(2.2, 2.0)
    assert player.goal == 2.0


def test_with_wrap_it_goes_the_shorter_way_and_has_no_ends() -> None:
    player = Player(WHEEL, place=3.0)
    player.drive(-3.0, 2.0)
    assert player.goal == pytest.approx(2 * math.pi - 3.0)  # on, over the end, and not all the way back
    player.drive(player.goal + 2 * math.pi, 1.0)
    assert player.goal == pytest.approx(2 * math.pi - 3.0)


@pytest.mark.parametrize(
    ("place", "target", "way"),
    [(0.0, 1.0, 1.0), (3.0, -3.0, 2 * math.pi - 6.0), (-3.0, 3.0, 6.0 - 2 * math.pi), (20 * math.pi, 0.5, 0.5)],
)
def test_the_shorter_way(place: float, target: float, way: float) -> None:
    assert shorter_way(place, target, 2 * math.pi) == pytest.approx(way)


def test_an_axis_that_was_not_measured_has_no_goal_and_is_not_driven() -> None:
    player = Player(place=math.nan)
    assert not player.shaper.is_known
    assert player.shaper.goals == [None]
    player.shaper.drive([1.0], 0.0)
    assert math.isnan(player.shaper.step(0.0, DT)[0])
    measured = Player(place=0.5)
    assert measured.shaper.is_known
    assert measured.shaper.goals == [0.5]
    assert measured.shaper.at_rest


@given(st.floats(0, 1e6), st.floats(0.01, 1e4), st.floats(1e-4, 0.1))
def test_from_the_stopping_speed_a_goal_stands_still_within_the_distance_and_not_long_before_it(
    distance: float, braking: float, dt: float
) -> None:
    rate = stopping_speed(distance, braking, dt)
    ticks = math.ceil(rate / (braking * dt))
    travelled = sum(max(0.0, rate - tick * braking * dt) * dt for tick in range(min(ticks, 20_000) + 1))
    if ticks <= 20_000:
        assert travelled == pytest.approx(distance, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(
    ("place", "pursued", "goal"), [(0.3, 0.4, 0.4), (0.3, 1.4, 0.3), (0.3, math.nan, 0.3), (-0.5, 0.5, 0.5)]
)
def test_it_begins_at_the_goal_that_the_robot_pursues_or_where_it_is_if_that_is_out_of_reach(
    place: float, pursued: float, goal: float
) -> None:
    shaper = AxisShaper([SHOULDER], hold=HOLD)
    shaper.begin([place], [pursued])
    assert shaper.goals == [goal]


@given(st.floats(-2.0, 2.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_a_gripper_goes_on_squeezing_whatever_has_become_of_the_arm(
    place: float, lag: float, width: float, squeeze: float
) -> None:
    gripper = msgspec.structs.replace(SHOULDER, name="gripper", grips=True)
    shaper = AxisShaper([SHOULDER, gripper], hold=HOLD)
    shaper.begin([place, width], [place + 3.0 * lag, width + 0.9 * squeeze])
    arm, grip = shaper.goals
    assert grip == width + 0.9 * squeeze
    assert arm == (place + 3.0 * lag if abs(place + 3.0 * lag - place) <= SHOULDER.reach else place)


def test_a_gripper_beyond_its_reach_begins_where_it_is_and_the_arm_keeps_its_goal() -> None:
    gripper = msgspec.structs.replace(SHOULDER, name="gripper", grips=True)
    shaper = AxisShaper([SHOULDER, gripper], hold=HOLD)
    shaper.begin([0.3, 0.0], [0.4, 1.5])
    assert shaper.goals == [0.4, 0.0]


@given(st.lists(st.sampled_from(["stay", "rest", "hold"]), min_size=1, max_size=6))
def test_a_gripper_that_rests_keeps_its_goal_though_it_is_measured_elsewhere(ways: list[str]) -> None:
    """Its goal is inside of what it holds; nothing but a command changes it."""
    gripper = msgspec.structs.replace(SHOULDER, name="gripper", grips=True)
    shaper, now = AxisShaper([gripper], hold=HOLD), 0.0
    shaper.begin([0.4], [0.0])
    for way in ways:
        if way == "rest":
            shaper.rest()
        elif way == "stay":
            shaper.drive([None], now)
        for _ in range(40):
            shaper.step(now, 0.01)
            now += 0.01
    assert shaper.goals == [0.0]


def test_where_the_axis_is_not_measured_a_pursued_goal_is_not_enough() -> None:
    shaper = AxisShaper([SHOULDER], hold=HOLD)
    shaper.begin([math.nan], [0.5])
    assert shaper.goals == [None]


axes = st.builds(
    lambda slew, brake, acceleration, wrap: msgspec.structs.replace(
        WHEEL if wrap else SHOULDER, slew=min(slew, brake * HOLD), brake=brake, acceleration=acceleration
    ),
    st.floats(0.05, 5),
    st.floats(0.5, 30),
    st.just(0.0) | st.floats(0.5, 60),
    st.booleans(),
)
happenings = st.tuples(
    st.sampled_from(["goal", "goal", "goal", "null", "rest", "cut", "brake", "nothing"]),
    st.floats(-4, 4),
    st.floats(0, 1),
    st.lists(st.floats(1e-6, 2 * DT) | st.floats(0, 0.5), min_size=1, max_size=30),
)


@settings(max_examples=400, deadline=None)
@given(axes, st.floats(-3, 3), st.lists(happenings, max_size=25))
def test_whatever_happens_the_goal_is_continuous_stays_in_limits_and_stands_still_in_time(
    axis: Axis, place: float, life: list[tuple[str, float, float, list[float]]]
) -> None:
    """Ticks come from nothing to two periods after each other, or long after where the bridge was held up."""
    shaper = AxisShaper([axis], hold=HOLD)
    shaper.begin([place], [place])
    now, last, rate = 0.0, -math.inf, 0.0
    steepest = max(axis.acceleration, axis.brake)
    for what, goal, speed, gaps in life:
        cut = what == "cut"
        match what:
            case "goal":
                shaper.drive([goal], now, speed)
                last = now
            case "null":
                shaper.drive([None], now)
                last = now
            case "rest":
                shaper.rest()
            case "cut":
                shaper.cut()
        for gap in gaps:
            now += gap
            before = shaper.values[0]
            after = (shaper.brake(DT) if what == "brake" else shaper.step(now, DT))[0]
            step = (after - before) / DT
            assert abs(step) <= axis.slew + ROUNDING
            assert abs(step - rate) <= steepest * max(DT, gap) + 1e-6 or cut
            if axis.wrap is None:
                assert min(axis.minimum, before) <= after <= max(axis.maximum, before), "it left its limits"
            if now >= last + HOLD and what != "brake":
                assert after == before, "it moves after hold"
            if what in ("null", "rest") and rate != 0:
                assert abs(step) <= max(0.0, abs(rate) - axis.brake * DT) + 1e-6, "it does not brake"
            rate, cut = step, False
        if what == "brake":  # for a robot that failed: nothing follows, and it has its own time
            return


@settings(max_examples=200, deadline=None)
@given(axes, st.floats(-2, 2), st.floats(-2, 2))
def test_from_anywhere_to_anywhere_it_arrives_exactly_without_going_back(axis: Axis, place: float, goal: float) -> None:
    shaper = AxisShaper([axis], hold=HOLD)
    shaper.begin([place], [place])
    way = goal - place if axis.wrap is None else shorter_way(place, goal, axis.wrap)
    now, gone = 0.0, 0.0
    while now < 2 * (abs(way) / axis.slew + 2 * axis.slew / min(axis.acceleration or axis.brake, axis.brake)) + 1:
        before = shaper.values[0]
        shaper.drive([goal], now)
        moved = shaper.step(now, DT)[0] - before
        assert abs(moved) < ROUNDING * DT or (moved > 0) == (way > 0), "it went back"
        gone += moved
        now += DT
    assert gone == pytest.approx(way, abs=1e-9)
    if axis.wrap is None:
        assert shaper.values[0] == goal
