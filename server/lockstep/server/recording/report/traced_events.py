"""Where the time of a recording's events went: its trace records, joined by event. No I/O."""

import heapq
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from lockstep.protocol.traces.trace import (
    COMMAND_WAY,
    PICTURE_WAY,
    CommandSpans,
    PictureSpans,
    Span,
    join_spans,
    known_spans,
    sum_of_spans,
)
from lockstep.server.recording.format.records import TraceRecord

__all__ = ["COMMAND", "PICTURE", "TracedEvent", "TracedEvents", "slowest", "slowest_by_time", "way_of"]

MOST_STREAMS = 16  # of which a report tells; a recording may name any number
COMMAND = COMMAND_WAY
PICTURE = tuple(span for span in PICTURE_WAY if span.name != "camera_wait_ms")  # that one comes before the capture


@dataclass
class TracedEvent:
    """One event; `time` in s since the beginning of the recording."""

    event: int
    time: float
    command: CommandSpans = field(default_factory=CommandSpans)
    pictures: dict[str, PictureSpans] = field(default_factory=dict)  # by camera

    def spans(self, stream: str) -> dict[str, float]:
        """Return the spans in ms by name: of the command for "", else of the picture of that camera."""
        way = PICTURE if stream else COMMAND
        known = known_spans(self.pictures.get(stream, PictureSpans()) if stream else self.command)
        return {span.name: known[span.name] for span in way if span.name in known}

    def total(self, stream: str) -> float:
        """Return the sum of those spans, in ms."""
        if not stream:
            return sum_of_spans(self.command)
        return sum_of_spans(self.pictures.get(stream, PictureSpans()), (span.name for span in PICTURE))


class TracedEvents:
    """All of one recording; give it the records in their order."""

    def __init__(self) -> None:
        self._events: dict[tuple[str, int], TracedEvent] = {}

    def add(self, record: TraceRecord, time: float) -> None:
        """Take a record that arrived at `time`, s since the beginning."""
        event = self._events.setdefault((record.epoch, record.event), TracedEvent(record.event, time))
        event.command = join_spans(event.command, record.command)
        if record.stream:
            known = event.pictures.get(record.stream, PictureSpans())
            event.pictures[record.stream] = join_spans(known, record.picture)

    def of(self, stream: str) -> list[TracedEvent]:
        """Return the events with spans of that camera's picture; for "", of a command."""
        return [each for each in self._events.values() if each.spans(stream)]

    @property
    def streams(self) -> list[str]:
        """The cameras with most traced pictures, `MOST_STREAMS` of them at most, the one with most first."""
        counts = Counter(stream for each in self._events.values() for stream in each.pictures)
        return heapq.nsmallest(MOST_STREAMS, counts, key=lambda name: (-counts[name], name))


def slowest(events: Sequence[TracedEvent], stream: str, count: int) -> list[TracedEvent]:
    """Return the events that took longest, the longest first."""
    return sorted(events, key=lambda each: -each.total(stream))[:count]


def slowest_by_time(
    events: Sequence[TracedEvent], stream: str, seconds: float, bins: int
) -> list[tuple[float, TracedEvent]]:
    """Return the slowest event of each of `bins` equal times, with that time's middle; empty ones are left out."""
    width = max(seconds, 0.001) / bins
    found: dict[int, TracedEvent] = {}
    for each in events:
        place = min(bins - 1, max(0, int(each.time / width)))
        if place not in found or each.total(stream) > found[place].total(stream):
            found[place] = each
    return [((place + 0.5) * width, found[place]) for place in sorted(found)]


def way_of(stream: str) -> tuple[Span, ...]:
    """Return the way of a camera's pictures; for "", of commands."""
    return PICTURE if stream else COMMAND
