"""The controller on simulated paths; every run is exact, in simulated time."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.server.media.quality.path.bandwidth_estimator import BandwidthEstimator, RateLimits
from tests.server.media.quality.path.simulated_path import LIMITS, SimulatedPath, steady

NARROW = steady(512_000)
FOR_PICTURES = 312_000  # of 512 kbit/s, beside sound and feedback


def test_an_ample_path_gets_everything_within_seconds() -> None:
    course = SimulatedPath().run(8)
    assert course.rates[-1] == LIMITS.maximum
    assert course.path.reason == ""
    assert not course.path.limited


def test_a_narrow_path_is_used_and_its_queue_stays_short() -> None:
    course = SimulatedPath(capacity=NARROW).run(60)
    assert max(course.after(10, course.queues)) < 0.2
    assert course.queue_share_above(0.1, after=10) < 0.06
    assert course.mean_sent(after=10) > 0.85 * FOR_PICTURES
    assert course.path.limited


def test_without_the_receivers_estimates_round_trips_are_enough() -> None:
    course = SimulatedPath(capacity=NARROW, estimates=False).run(60)
    assert max(course.after(10, course.queues)) < 0.3
    assert course.mean_sent(after=10) > 0.85 * FOR_PICTURES


def test_a_computer_that_is_busy_now_and_then_is_not_taken_for_a_queue() -> None:
    course = SimulatedPath(capacity=NARROW, spikes=0.1).run(60)
    assert course.mean_sent(after=10) > 0.8 * FOR_PICTURES


def test_a_path_that_becomes_narrow_is_followed_and_its_queue_emptied() -> None:
    course = SimulatedPath(capacity=lambda now: 4e6 if now < 20 else 4e5).run(60)
    assert max(course.after(26, course.queues)) < 0.35
    assert max(course.after(40, course.queues)) < 0.25


def test_a_path_that_becomes_wide_again_is_used_again() -> None:
    course = SimulatedPath(capacity=lambda now: 4e5 if 20 < now < 40 else 4e6).run(100)
    assert course.rates[-1] == LIMITS.maximum


def test_a_satellites_round_trip_is_no_queue() -> None:
    course = SimulatedPath(base=0.6).run(20)
    assert course.rates[-1] == LIMITS.maximum


def test_a_path_that_became_longer_is_not_starved() -> None:
    course = SimulatedPath().run(20)
    path = course.path
    now = 20.0
    for _ in range(100):  # from now on every round trip takes 150 ms more
        now += 0.33
        path.received(0, 40, 0.19, now)
        path.sending.add(round(now * path.rate / 8), now)
        path.decide(now)
    assert path.round_trips.base == pytest.approx(0.19)
    assert path.rate > 0.25 * LIMITS.maximum


@pytest.mark.parametrize("loss", [0.01, 0.05, 0.10])
def test_a_path_that_always_loses_packets_is_used_all_the_same(loss: float) -> None:
    assert SimulatedPath(loss=loss).run(60).rates[-1] == LIMITS.maximum


def test_sudden_loss_without_a_queue_costs_half_the_rate_at_most() -> None:
    path = BandwidthEstimator(RateLimits(80_000, 1_000_000, 1_000_000), 0.0)
    path.received(0, 100, 0.04, 0.5)
    rates = []
    for step in range(1, 40):
        now = 0.5 + step
        path.received(30, 100, 0.04, now)
        path.sending.add(step * 125_000, now)
        path.decide(now)
        rates.append(path.rate)
    assert 500_000 <= min(rates) < 900_000
    assert rates[-1] == 1_000_000  # it turned out to be the path's own


def test_silence_lowers_step_by_step_and_the_end_of_it_gives_half_back() -> None:
    course = SimulatedPath(reports=lambda now: not 20 < now < 30).run(30)
    assert course.rates[200] == LIMITS.maximum
    assert course.rates[-1] == LIMITS.minimum
    assert course.path.reason == "no feedback"
    course.path.heard(30.0)
    assert course.path.rate == LIMITS.maximum / 2


def test_a_peer_that_never_reports_gets_the_least() -> None:
    course = SimulatedPath(reports=lambda now: False).run(15)
    assert course.rates[-1] == LIMITS.minimum


def test_nobody_is_called_silent_while_nothing_is_sent() -> None:
    path = BandwidthEstimator(LIMITS, 0.0)
    path.sending.add(0, 0.0)
    path.sending.add(0, 10.0)
    path.decide(10.0)
    assert path.rate == LIMITS.start


def test_the_gap_lowers_the_rate_before_it_reaches_the_tolerance() -> None:
    course = SimulatedPath(lag=lambda now: 1 if now < 20 else 3).run(24)
    assert course.rates[199] == LIMITS.maximum
    assert min(course.after(20, course.rates)) < LIMITS.maximum
    assert course.path.reason == "gap"


def test_a_gap_that_was_always_there_is_not_caused_by_the_rate() -> None:
    assert SimulatedPath(lag=lambda now: 4).run(30).rates[-1] == LIMITS.maximum


def test_a_gap_that_lower_rates_do_not_narrow_is_left_alone() -> None:
    course = SimulatedPath(lag=lambda now: 1 if now < 20 else 4).run(50)
    assert min(course.rates[50:]) >= 0.5 * LIMITS.maximum
    assert course.rates[-1] > 0.9 * LIMITS.maximum


def test_an_undemanding_picture_keeps_its_rate_but_does_not_raise_it() -> None:
    course = SimulatedPath(demand=200_000).run(30)
    assert course.rates[-1] == course.rates[0] == LIMITS.start


def test_an_estimate_that_falls_alone_lowers_nothing() -> None:
    path = BandwidthEstimator(LIMITS, 0.0)
    for i in range(1, 30):
        path.received(0, 30, 0.04, i * 0.3)
        path.estimated(900_000 / i, i * 0.3)
        path.decide(i * 0.3)
    assert path.rate == LIMITS.start


def test_round_trips_measured_while_this_computer_is_late_count_for_nothing() -> None:
    path = BandwidthEstimator(LIMITS, 0.0)
    for i in range(40):
        now = i * 0.2
        path.late(now)
        path.received(0, 30, 0.04 + 0.01 * i, now)
        path.decide(now)
    assert path.rate == LIMITS.start


@settings(max_examples=40, deadline=None)
@given(
    capacity=st.floats(150_000, 5e6),
    base=st.floats(0.0, 0.7),
    loss=st.floats(0, 0.3),
    spikes=st.floats(0, 0.5),
    demand=st.floats(10_000, 5e6),
    seed=st.integers(0, 1000),
)
def test_the_rate_stays_within_its_limits_on_any_path(
    capacity: float, base: float, loss: float, spikes: float, demand: float, seed: int
) -> None:
    course = SimulatedPath(
        capacity=steady(capacity), base=base, loss=loss, spikes=spikes, demand=demand, other=100_000, seed=seed
    ).run(20)
    assert all(LIMITS.minimum <= rate <= LIMITS.maximum for rate in course.rates)
    assert course.path.paused_until <= 21.0


@settings(max_examples=25, deadline=None)
@given(capacity=st.floats(400_000, 3e6), base=st.floats(0.01, 0.3), seed=st.integers(0, 1000))
def test_on_any_steady_path_the_queue_is_short_once_it_is_known(capacity: float, base: float, seed: int) -> None:
    course = SimulatedPath(capacity=steady(capacity), base=base, seed=seed).run(60)
    assert course.queue_share_above(0.15 + base / 2, after=15) < 0.12
    useful = min(LIMITS.maximum, capacity - 200_000)
    assert course.mean_sent(after=15) > 0.6 * useful


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from("rselq"), st.floats(0, 1e9, allow_nan=False)), max_size=60))
def test_no_report_breaks_it(inputs: list[tuple[str, float]]) -> None:
    path = BandwidthEstimator(LIMITS, 0.0)
    for i, (kind, value) in enumerate(inputs):
        now = i * 0.1
        if kind == "r":
            path.received(int(value), int(value), value, now)
        elif kind == "s":
            path.sending.add(int(value), now)
        elif kind == "e":
            path.estimated(value, now)
        elif kind == "l":
            path.lagged(int(value), 4, now)
        else:
            path.received(3, 2, None, now)
        path.decide(now)
        assert LIMITS.minimum <= path.rate <= LIMITS.maximum
        assert math.isfinite(path.paused_until)


def test_a_peer_that_had_no_camera_when_it_stepped_back_is_not_left_without_a_rate() -> None:
    path = BandwidthEstimator(LIMITS, 0.0)
    path.assume(0.0, 1.0)  # what no cameras need
    assert path.rate == LIMITS.minimum > 0
