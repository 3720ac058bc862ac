"""The thesis' figures of a recorded session."""

from pathlib import Path

import pytest

from lockstep.protocol.console import Report, StreamReport
from lockstep.protocol.traces.trace import CommandSpans, PictureSpans
from lockstep.server.recording.format.records import ReportRecord, TraceRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.report.report import write_report
from lockstep.server.recording.report.session import read_session
from lockstep.server.recording.report.traced_events import MOST_STREAMS, TracedEvents, slowest, slowest_by_time
from tests.server.recording.makers import CODECS, EPOCH, START, Story, own_entry, rewritten


def test_a_session_becomes_series_over_time(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=80, force_at=20).write(path)
    session = read_session(path)
    assert session.robot.values == list(range(1, 81))
    assert session.streams["front"].captured.values == list(range(2, 81))
    assert session.streams["front"].gap.values == [1, 1, 1]
    assert {round(each) for each in session.answered.values} == {10}
    assert max(session.force.values) == 5.0


def test_the_report_draws_every_stream_and_says_what_was_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=80, force_at=20).write(path)
    text = write_report(path, tmp_path / "a.html").read_text()
    assert text.count("<svg") == 7  # the session at a glance, events, camera, microphone, delays, force, axes
    assert "front: server" in text
    assert "times not" not in text
    assert text.count("nothing was reported") == 5  # of the microphone, and no command → picture


def test_a_session_that_no_page_reported_of_says_so_where_its_figures_would_be(tmp_path: Path) -> None:
    reports = OWN_TOPICS[ReportRecord]
    path = rewritten(
        tmp_path / "a.mcap", Story(events=80).entries(), lambda each: [] if each.topic == reports else [each]
    )
    text = write_report(path, tmp_path / "a.html").read_text()
    assert text.count("nothing was reported") > 6
    assert "−0.04" not in text  # an axis of nothing


def _trace(event: int, **fields: object) -> TraceRecord:
    return TraceRecord(epoch=EPOCH, event=event, **fields)  # type: ignore[arg-type]


def test_records_of_one_event_complete_each_other() -> None:
    traced = TracedEvents()
    traced.add(_trace(5, command=CommandSpans(forward_ms=1.0)), 0.1)
    traced.add(_trace(5, stream="front", picture=PictureSpans(camera_wait_ms=9.0, capture_ms=2.0)), 0.2)
    page = PictureSpans(draw_ms=3.0)
    traced.add(_trace(5, peer="p1", command=CommandSpans(input_ms=4.0), stream="front", picture=page), 0.3)
    (event,) = traced.of("")
    assert event.spans("") == {"input_ms": 4.0, "forward_ms": 1.0}
    assert event.spans("front") == {"capture_ms": 2.0, "draw_ms": 3.0}  # the camera's wait comes before the way
    assert (event.total(""), event.total("front")) == (5.0, 5.0)
    assert traced.streams == ["front"]


def test_of_any_number_of_cameras_only_those_with_most_pictures_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    traced = TracedEvents()
    for number in range(3000):
        stream = "front" if number % 3 == 0 else f"made up {number}"
        traced.add(TraceRecord(epoch="e", event=number, stream=stream, picture=PictureSpans(encode_ms=1.0)), 0.0)
    looks: list[str] = []
    monkeypatch.setattr(TracedEvents, "of", lambda _, stream: looks.append(stream))
    assert len(traced.streams) == MOST_STREAMS
    assert traced.streams[0] == "front"
    assert looks == [], "each name would cost a look at every event"


def test_a_client_that_reports_ever_new_cameras_costs_no_figure_for_each(tmp_path: Path) -> None:
    entries = list(Story(events=3).entries())
    for number in range(100):
        streams = [StreamReport(stream=f"made up {number}", carrier="native", stamp=1)]
        record = ReportRecord(epoch=EPOCH, event=1, peer="p1", name="Ada", report=Report(event=1, streams=streams))
        entries.append(own_entry(record, START + number))
    path = rewritten(tmp_path / "a.mcap", sorted(entries, key=lambda entry: entry.arrived), lambda entry: [entry])
    assert len(read_session(path).streams) <= MOST_STREAMS + len(CODECS)


def test_a_slow_event_is_found_in_its_time_and_in_the_whole_session() -> None:
    traced = TracedEvents()
    for event in range(1, 101):
        spans = CommandSpans(measure_ms=40.0 if event == 77 else 1.0)
        traced.add(_trace(event, command=spans), event * 0.1)
    assert slowest(traced.of(""), "", 1)[0].event == 77
    bins = slowest_by_time(traced.of(""), "", 10.0, 10)
    assert len(bins) == 10
    assert [each.event for middle, each in bins if 7 <= middle < 8] == [77]


def test_the_report_explains_the_slowest_moments(tmp_path: Path) -> None:
    story = Story(events=80)
    spans = PictureSpans(capture_ms=2.0, encode_ms=77.7)
    entries = [*story.entries(), own_entry(_trace(40, stream="front", picture=spans), START + 3_000_000_000)]
    path = rewritten(tmp_path / "a.mcap", sorted(entries, key=lambda entry: entry.arrived), lambda entry: [entry])
    text = write_report(path, tmp_path / "a.html").read_text()
    assert "Where each millisecond went" in text
    assert "encode 77.7" in text
    assert "Slowest commands" not in text
