"""Reads a recorded session as series over time. Times in s since its beginning, on the recording's clock."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import ReportRecord, TraceRecord
from lockstep.server.recording.format.topics import stream_of
from lockstep.server.recording.reading.bookmarks import Mark
from lockstep.server.recording.reading.command_delays import CommandDelays
from lockstep.server.recording.reading.event_rows import EventRow, event_rows
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.session_parts import session_parts
from lockstep.server.recording.report.traced_events import MOST_STREAMS, TracedEvents

__all__ = ["Series", "Session", "Shown", "read_session"]

SECOND = 1_000_000_000


@dataclass
class Series:
    """Values over time."""

    times: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def add(self, time: float, value: float) -> None:
        self.times.append(time)
        self.values.append(value)


@dataclass
class Shown:
    """One stream: as it was captured, and as the operator's page reported its rendering."""

    captured: Series = field(default_factory=Series)  # stamp, at the time of capture
    stamp: Series = field(default_factory=Series)  # newest stamp at the operator
    rendered: Series = field(default_factory=Series)  # number of renderings
    gap: Series = field(default_factory=Series)
    tolerance: Series = field(default_factory=Series)


@dataclass
class Session:
    info: RecordingInfo
    description: RobotDescription
    seconds: float
    marks: list[Mark]
    began: int  # µs since 1970
    streams: dict[str, Shown] = field(default_factory=dict)
    robot: Series = field(default_factory=Series)  # event, at the time of its measurement at the robot
    operator: Series = field(default_factory=Series)  # event, as the operator's page reported it
    answered: Series = field(default_factory=Series)  # ms from a command to its feedback, both at the console
    picture_delay: Series = field(default_factory=Series)  # ms, by the operator's own clock
    round_trip: Series = field(default_factory=Series)  # ms
    force: Series = field(default_factory=Series)  # N
    commanded: dict[str, Series] = field(default_factory=dict)  # by axis; NaN where a goal axis was to stay
    measured: dict[str, Series] = field(default_factory=dict)
    applied: dict[str, Series] = field(default_factory=dict)  # by goal axis: where it was commanded to be then
    traced: TracedEvents = field(default_factory=TracedEvents)  # where the time of each event went


def read_session(path: Path, *, alone: bool = False) -> Session:
    """Read a recording, with all parts of the session if it is the first and not `alone`.

    What is damaged in a later part is left out.

    Raises:
        RecordingError, OSError: it cannot be read.
    """
    first, *others = [path] if alone else session_parts(path).files
    with RecordingReader(first) as reader:
        session = Session(
            info=reader.info,
            description=reader.description(),
            seconds=0.0,
            marks=[],
            began=reader.index.started,
        )
        _take_part(session, reader)
    for other in others:
        with suppress(RecordingError), RecordingReader(other) as reader:  # the check of the promises tells it
            _take_part(session, reader)
    return session


def _take_part(session: Session, reader: RecordingReader) -> None:
    origin, axes = session.began * 1000, reader.description().axes
    known = {axis.name for axis in session.description.axes}
    session.description = msgspec.structs.replace(
        session.description, axes=(*session.description.axes, *(axis for axis in axes if axis.name not in known))
    )
    session.seconds = (reader.index.ended - session.began) / 1e6
    session.marks.extend(reader.index.marks)
    for row in event_rows(reader):
        _take_row(session, row, (row.captured - origin) / SECOND, axes)
    delays = CommandDelays()
    for record in reader.records():
        stream = stream_of(record.topic)
        if stream:
            shown = session.streams.setdefault(stream, Shown())
            shown.captured.add((record.captured - origin) / SECOND, record.event)
            continue
        at = (record.arrived - origin) / SECOND
        own = own_record_of(record.schema, record.data)
        if (delay := delays.take(own, record.arrived)) is not None:
            session.answered.add(at, delay)
        match own:
            case TraceRecord() as trace:
                session.traced.add(trace, at)
            case ReportRecord() as report:
                _take_report(session, report, at)


def _take_row(session: Session, row: EventRow, at: float, described: Sequence[Axis]) -> None:
    """`described`: the axes of the file that has the row."""
    feedback, command = row.feedback, row.command
    session.robot.add(at, feedback.event)
    if len(feedback.wrench) >= 3:
        session.force.add(at, math.hypot(*feedback.wrench[:3]))
    axes = list(zip(described, feedback.axes, strict=False))
    for axis, value in axes:
        session.measured.setdefault(axis.name, Series()).add(at, value)
    for (axis, measured), asked in zip(axes, [] if command is None else command.values, strict=False):
        value = math.nan if asked is None else _beside(axis, measured, asked)
        session.commanded.setdefault(axis.name, Series()).add(at, value)
    for (axis, measured), goal in zip(axes, feedback.goals, strict=False):
        if goal is not None:
            session.applied.setdefault(axis.name, Series()).add(at, _beside(axis, measured, goal))


def _beside(axis: Axis, measured: float, goal: float) -> float:
    """Return the goal, of an axis that turns on and on as the same place that is nearest to the measured value."""
    return measured + math.remainder(goal - measured, axis.wrap) if axis.wrap else goal


def _take_report(session: Session, record: ReportRecord, at: float) -> None:
    report = record.report
    if report.event:
        session.operator.add(at, report.event)
    if report.picture_delay_ms is not None:
        session.picture_delay.add(at, report.picture_delay_ms)
    if report.round_trip_ms is not None:
        session.round_trip.add(at, report.round_trip_ms)
    for stream in report.streams:
        if stream.stream not in session.streams and len(session.streams) >= MOST_STREAMS:
            continue  # a client may say any name; each costs a figure
        shown = session.streams.setdefault(stream.stream, Shown())
        if stream.stamp:
            shown.stamp.add(at, stream.stamp)
        shown.rendered.add(at, stream.rendered)
        if stream.rendered:
            shown.gap.add(at, stream.gap)
            shown.tolerance.add(at, stream.tolerance)
