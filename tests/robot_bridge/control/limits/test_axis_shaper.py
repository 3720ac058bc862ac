import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.control.limits.axis_shaper import LATE_TIMER, AxisShaper
from tests.robot_bridge.control.core_helpers import AXES

HOLD = 0.3
DT = 0.004


def ticks(shaper: AxisShaper, start: float, seconds: float) -> list[tuple[float, list[float]]]:
    """Step for a while; the time of each step and what was applied from then on."""
    times = [start + index * DT for index in range(round(seconds / DT))]
    return [(now, shaper.step(now, DT)) for now in times]


def test_values_begin_at_rest() -> None:
    shaper = AxisShaper(AXES, hold=HOLD)
    assert shaper.values == [0.0, 0.2]
    assert shaper.at_rest
    assert shaper.step(0.0, DT) == [0.0, 0.2]


def test_a_command_is_approached_at_the_slew_rate_and_reached() -> None:
    shaper = AxisShaper(AXES, hold=10.0)
    shaper.drive([0.5, 0.2], 0.0)
    steps = [values[0] for _, values in ticks(shaper, 0.0, 1.0)]
    assert steps[:3] == pytest.approx([0.016, 0.032, 0.048])
    assert steps[40] == 0.5
    assert not shaper.at_rest


@pytest.mark.parametrize(
    ("asked", "reached"), [([9.0, 9.0], [1.0, 0.5]), ([-9.0, -9.0], [-1.0, 0.1]), ([1.0, 0.5], [1.0, 0.5])]
)
def test_a_command_is_clamped_to_the_limits(asked: list[float], reached: list[float]) -> None:
    shaper = AxisShaper(AXES, hold=10.0)
    shaper.drive(asked, 0.0)
    assert ticks(shaper, 0.0, 2.0)[-1][1] == pytest.approx(reached)


def test_without_another_command_all_is_at_rest_when_hold_has_passed() -> None:
    shaper = AxisShaper(AXES, hold=HOLD)
    shaper.drive([1.0, 0.5], 0.0)
    steps = ticks(shaper, 0.0, 0.6)
    assert max(values[0] for _, values in steps) > 0.5
    assert all(values == [0.0, 0.2] for now, values in steps if now >= HOLD)
    assert shaper.at_rest


@pytest.mark.parametrize("phase", [0.0, 0.001, 0.002, 0.0039])
def test_no_motion_that_a_tick_applies_lasts_beyond_hold(phase: float) -> None:
    """What is applied lasts until the next tick, which may be late, so the last tick in time for that applies rest."""
    shaper = AxisShaper(AXES, hold=HOLD)
    shaper.drive([1.0, 0.5], 0.0)
    steps = ticks(shaper, phase, 0.6)
    moves = [now for now, values in steps if values != [0.0, 0.2]]
    assert HOLD - 2 * DT < moves[-1] + DT + LATE_TIMER <= HOLD + 1e-9


def test_the_ramp_to_rest_is_no_steeper_than_the_brake() -> None:
    shaper = AxisShaper(AXES, hold=HOLD)
    shaper.drive([1.0, 0.5], 0.0)
    steps = [values for _, values in ticks(shaper, 0.0, 0.4)]
    for before, after in itertools.pairwise(steps):
        for axis, old, new in zip(AXES, before, after, strict=True):
            assert abs(new - old) <= max(axis.brake, axis.slew) * DT + 1e-9


def test_commands_in_time_keep_it_going() -> None:
    shaper = AxisShaper(AXES, hold=HOLD)
    speed = 0.0
    for index in range(20):
        shaper.drive([0.8, 0.2], index * 0.1)
        speed = ticks(shaper, index * 0.1, 0.1)[-1][1][0]
    assert speed == pytest.approx(0.8)


def test_rest_brakes_at_once_and_a_new_command_drives_again() -> None:
    shaper = AxisShaper(AXES, hold=10.0)
    shaper.drive([1.0, 0.2], 0.0)
    ticks(shaper, 0.0, 1.0)
    shaper.rest()
    assert shaper.step(1.0, DT)[0] == pytest.approx(1.0 - 10 * DT)
    assert ticks(shaper, 1.004, 0.2)[-1][1] == [0.0, 0.2]
    assert shaper.at_rest
    shaper.drive([1.0, 0.2], 1.3)
    assert shaper.step(1.3, DT)[0] == pytest.approx(4 * DT)


def test_a_neutral_command_leaves_it_at_rest() -> None:
    shaper = AxisShaper(AXES, hold=HOLD)
    shaper.drive([0.0, 0.2], 0.0)
    shaper.step(0.0, DT)
    assert shaper.at_rest


def test_after_missed_ticks_past_hold_the_first_step_is_at_rest() -> None:
    shaper = AxisShaper(AXES, hold=HOLD)
    shaper.drive([1.0, 0.5], 0.0)
    ticks(shaper, 0.0, 0.1)
    assert shaper.step(5.0, DT) == [0.0, 0.2]


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(0, 0.5), st.booleans()), max_size=12),
    st.lists(st.floats(0.001, 0.4), min_size=1, max_size=40),
)
def test_whatever_is_commanded_values_stay_in_limits_and_at_rest_hold_after_the_last(
    commands: list[tuple[float, float, bool]], gaps: list[float]
) -> None:
    axis = Axis(name="a", label="A", unit="m/s", minimum=-1, maximum=2, slew=3, brake=8, rest=0.5)
    shaper = AxisShaper([axis], hold=HOLD)
    now = last = 0.0
    for value, pause, rest in commands:
        now += pause
        if rest:
            shaper.rest()
        else:
            shaper.drive([value], now)
            last = now
        assert axis.minimum <= shaper.step(now, DT)[0] <= axis.maximum
    for gap in gaps:
        now += gap
        applied = shaper.step(now, DT)[0]
        assert axis.minimum <= applied <= axis.maximum
        if now + DT + LATE_TIMER >= last + HOLD:
            assert applied == axis.rest


@given(st.lists(st.tuples(st.floats(1e-6, 2 * DT), st.none() | st.floats(-1, 1)), max_size=200))
def test_a_tick_changes_a_value_by_no_more_than_the_rate_allows_for_its_period_or_the_time_before_it(
    beats: list[tuple[float, float | None]],
) -> None:
    """Ticks that begin on commands are from nothing to two periods apart."""
    shaper, now = AxisShaper(AXES, hold=HOLD), 0.0
    for gap, command in beats:
        now += gap
        if command is not None:
            shaper.drive([command, 0.5], now)
        before = shaper.values
        for axis, old, new in zip(AXES, before, shaper.step(now, DT), strict=True):
            assert abs(new - old) <= max(axis.slew * DT, axis.brake * max(DT, gap)) + 1e-9
