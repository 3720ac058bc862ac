import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.statistics import (
    RATE_WINDOW,
    ConsoleStatistics,
    EventRate,
    Percentiles,
    PictureDelay,
    StreamStatistics,
    percentiles,
)
from lockstep.protocol.serial import MAX_EVENT


def test_percentiles_are_of_nearest_rank() -> None:
    figures = percentiles([float(value) for value in range(100, 0, -1)])
    assert figures == Percentiles(count=100, median=50.0, p95=95.0, p99=99.0, maximum=100.0)


def test_without_samples_there_are_no_percentiles() -> None:
    assert percentiles([]) == Percentiles()


@given(st.lists(st.floats(0, 1e6), min_size=1))
def test_percentiles_are_samples_in_order(samples: list[float]) -> None:
    figures = percentiles(samples)
    found = [figures.median, figures.p95, figures.p99, figures.maximum]
    assert all(value in samples for value in found)
    assert found == sorted(found, key=lambda value: value or 0.0)


def test_the_event_rate_is_that_of_the_last_seconds_and_crosses_the_wrap() -> None:
    rate = EventRate()
    assert rate.rate(0.0) == 0.0
    for number in range(11):
        rate.event((MAX_EVENT - 5 + number) % MAX_EVENT or MAX_EVENT, number * 0.1)
    assert rate.rate(1.0) == pytest.approx(10, rel=0.15)
    assert rate.rate(1.0 + 2 * RATE_WINDOW) == 0.0


def test_an_event_that_is_measured_again_is_one_event() -> None:
    rate = EventRate()
    rate.event(1, 0.0)
    rate.event(1, 0.5)
    assert rate.rate(0.5) == 0.0


def test_the_picture_delay_runs_from_the_command_to_the_first_picture_of_its_event() -> None:
    delay = PictureDelay()
    delay.sent(2, 1.0)
    delay.shown(1, 1.01)
    assert not delay.samples
    delay.sent(3, 1.02)
    delay.shown(3, 1.05)
    delay.shown(3, 9.0)
    assert list(delay.samples) == pytest.approx([0.05, 0.03])


def test_a_stream_reports_what_the_server_may_know() -> None:
    stream = StreamStatistics(stream="front", kind="video", codec="VP8", carrier="native", stamp=4, rendered=2)
    report = stream.report()
    assert (report.stream, report.carrier, report.stamp, report.rendered) == ("front", "native", 4, 2)


def test_the_names_are_those_of_the_page() -> None:
    names = set(msgspec.to_builtins(ConsoleStatistics()))
    page = {"peer", "event", "epoch", "armed", "streams", "picture_delay_ms", "round_trip_ms", "event_rate"}
    assert page | {"command_to_feedback_ms", "bad_messages", "picture_delay_p50_ms", "picture_delay_p95_ms"} <= names


def test_the_picture_delay_of_now_counts_the_wait_and_is_forgotten() -> None:
    delay = PictureDelay()
    assert delay.known(0.0) is None
    delay.sent(2, 0.0)
    delay.shown(2, 0.03)
    assert delay.known(0.1) == pytest.approx(0.03)
    delay.sent(3, 1.0)
    assert delay.known(1.8) == pytest.approx(0.8)
    assert delay.known(3.03) is not None
    assert delay.known(3.04) is None
