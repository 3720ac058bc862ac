import pytest

from lockstep.bench.experiment.judge.measures import beyond, event_rate, share_within, spread
from lockstep.bench.experiment.judge.record import Arrival, Rendered


def picture(at: float, stamp: int | None, feedback: int | None = None) -> Rendered:
    gap = None if stamp is None or feedback is None else feedback - stamp
    return Rendered(at, stamp, gap, feedback, None)


def test_renderings_beyond_the_tolerance_are_counted_from_feedback_and_stamp() -> None:
    lying = Rendered(0.0, 1, 0, 10, None)  # its gap says 0
    assert beyond([lying, picture(1, 6, 10), picture(2, 14, 10), picture(3, 15, 10), picture(4, None, 10)], 4) == 2


def test_the_event_rate_runs_from_the_first_to_the_last_feedback() -> None:
    assert event_rate([Arrival(1.0, 5), Arrival(1.2, 6), Arrival(3.0, 25)]) == pytest.approx(10)
    assert event_rate([Arrival(1.0, 5)]) == 0.0


def test_a_picture_counts_as_within_until_the_feedback_has_moved_too_far() -> None:
    feedbacks = [Arrival(0.0, 10), Arrival(2.0, 11), Arrival(4.0, 12)]
    assert share_within(feedbacks, [picture(1.0, 10)], 1, until=5.0) == pytest.approx(0.75)


def test_the_next_picture_brings_it_back_within() -> None:
    feedbacks = [Arrival(0.0, 10), Arrival(2.0, 20)]
    found = share_within(feedbacks, [picture(0.0, 10), picture(3.0, 19)], 4, until=4.0)
    assert found == pytest.approx(0.75)


def test_time_before_the_first_picture_does_not_count() -> None:
    assert share_within([Arrival(0.0, 1)], [picture(9.0, 1)], 0, until=10.0) == 1.0


def test_without_a_picture_there_is_no_share() -> None:
    assert share_within([Arrival(0.0, 1)], [], 0, until=10.0) is None
    assert share_within([Arrival(0.0, 1)], [picture(1.0, None)], 0, until=10.0) is None
    assert share_within([], [picture(1.0, 1)], 0, until=1.0) is None


def test_a_picture_without_any_feedback_is_not_within() -> None:
    assert share_within([], [picture(1.0, 1)], 0, until=2.0) == 0.0


def test_percentiles_are_in_ms_and_none_without_samples() -> None:
    assert spread([0.1, 0.2]) == {"p50": 100.0, "p95": 200.0, "p99": 200.0, "max": 200.0}
    assert spread([]) == {"p50": None, "p95": None, "p99": None, "max": None}
