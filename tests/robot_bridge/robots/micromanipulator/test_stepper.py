import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.robots.micromanipulator.stepper import STEP, Stepper

TICK = 0.004


def test_it_stands_on_whole_steps_only() -> None:
    drive = Stepper(10.001e-6)
    assert drive.position == pytest.approx(round(10.001e-6 / 32e-9) * 32e-9, abs=1e-15)
    for _ in range(100):
        drive.tick(3.3e-6, TICK)
        assert drive.position / STEP == pytest.approx(round(drive.position / STEP), abs=1e-6)


@given(st.floats(min_value=-60e-6, max_value=60e-6), st.integers(min_value=1, max_value=500))
def test_over_time_it_goes_as_far_as_it_is_told_to_within_half_a_step(velocity: float, ticks: int) -> None:
    drive = Stepper(0.0)
    for _ in range(ticks):
        drive.tick(velocity, TICK)
    assert abs(drive.position - velocity * ticks * TICK) <= STEP * 0.51


def test_a_speed_below_a_step_a_tick_is_single_steps_now_and_then() -> None:
    drive = Stepper(0.0)
    places = []
    for _ in range(1000):
        drive.tick(1e-6, TICK)  # an eighth of a step a tick
        places.append(drive.steps)
    jumps = [late - early for early, late in zip(places, places[1:], strict=False)]
    assert set(jumps) == {0, 1}
    assert drive.speed == pytest.approx(1e-6, rel=0.5)


def test_a_step_begun_is_forgotten_at_rest() -> None:
    drive = Stepper(0.0)
    for _ in range(50):
        drive.tick(3e-6, TICK)
        drive.tick(0.0, TICK)
    assert drive.steps == 0


def test_it_is_measured_as_standing_soon_after_it_stands() -> None:
    drive = Stepper(0.0)
    for _ in range(100):
        drive.tick(60e-6, TICK)
    assert drive.speed == pytest.approx(60e-6, rel=0.1)
    assert drive.rate == pytest.approx(60e-6 / STEP, rel=0.1)
    for _ in range(100):
        drive.tick(0.0, TICK)
    assert (drive.speed, drive.rate) == (0.0, 0.0)
