import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.media.sources.capture_timeline import DRIFT, CaptureTimeline


def test_without_a_time_of_its_own_a_medium_is_placed_by_its_arrival() -> None:
    timeline = CaptureTimeline(0.2)
    assert timeline.place(None, 0.02, 10.0) == pytest.approx(9.78)


def test_nothing_is_placed_before_the_quickest_is_known() -> None:
    timeline = CaptureTimeline(0.1, settle=0.5)
    placed = [timeline.place(i / 10, 0.0, 100 + i / 10) for i in range(10)]
    assert placed[:5] == [None] * 5
    assert placed[5] == pytest.approx(100.4)


def test_what_waited_on_its_way_is_placed_where_it_was_captured() -> None:
    timeline = CaptureTimeline(0.1, settle=0.0)
    timeline.place(0.0, 0.0, 100.1)
    assert timeline.place(0.1, 0.0, 100.6) == pytest.approx(100.1, abs=0.001)
    assert timeline.lag == pytest.approx(0.4, abs=0.001)


def test_a_connection_that_begins_with_old_pictures_shows_none_of_them_as_new() -> None:
    timeline = CaptureTimeline(0.0, settle=0.5)
    backlog = [timeline.place(i / 30, 0.0, 102.0 + i / 1000) for i in range(60)]  # two seconds at once
    assert backlog == [None] * 60
    assert timeline.place(2.6, 0.0, 102.6) == pytest.approx(102.6)


def test_a_clock_that_jumps_is_learnt_anew_and_what_was_late_stays_so() -> None:
    timeline = CaptureTimeline(0.0, settle=0.5)
    for i in range(10):
        timeline.place(i / 10, 0.0, 100 + i / 10)
    timeline.place(1.0, 0.0, 101.4)  # 0.4 s late
    assert timeline.place(500.0, 0.0, 101.5) is None
    assert timeline.place(500.6, 0.0, 102.1) == pytest.approx(101.7, abs=0.01)
    assert timeline.place(3.0, 0.0, 102.2) is None


def test_a_source_whose_clock_runs_slow_is_followed() -> None:
    timeline = CaptureTimeline(0.0, settle=0.0)
    placed = [timeline.place(i * 0.9999, 0.0, float(i)) for i in range(1000)]
    assert placed[-1] == pytest.approx(999, abs=0.001)
    assert DRIFT > 0.0001


@given(
    seed=st.integers(0, 2**32),
    skew=st.floats(-DRIFT, DRIFT),
    least=st.floats(0.0, 0.5),
    origin=st.floats(-1e6, 1e6),
    sound=st.booleans(),
)
def test_no_medium_is_placed_later_than_it_was_captured(
    seed: int, skew: float, least: float, origin: float, sound: bool
) -> None:
    """Whatever the delays are, if the quickest took at least the latency; but for the drift of two clocks."""
    chance = random.Random(seed)
    timeline = CaptureTimeline(least, settle=0.5)
    length = 0.02 if sound else 0.0
    arrived = 0.0
    for i in range(200):
        captured = 1000 + i / 30
        delay = least if i == 0 else least + chance.choice((0.0, 0.01, 0.3, 1.5)) * chance.random()
        arrived = max(arrived, captured + length + delay)  # in order
        placed = timeline.place(origin + (captured - 1000) * (1 + skew), length, arrived)
        if placed is not None:
            assert placed <= captured + 1e-6 + 2 * DRIFT * (arrived - 1000)
