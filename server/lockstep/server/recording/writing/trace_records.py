"""Makes records of where the time of events went (docs/traces.md)."""

from collections.abc import Callable

from lockstep.server.event_clock import EventClock
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.recording.format.records import OwnRecord, TraceRecord
from lockstep.server.session_events import EventsTraced, FeedbackReceived, SessionEvents

__all__ = ["TraceRecords"]


class TraceRecords:
    """For each event of a recording: spans of the command, of the first picture of each camera, and of the client."""

    def __init__(self, clock: EventClock, put: Callable[[OwnRecord], None]) -> None:
        self._clock = clock
        self._put = put
        self._newest: dict[str, int] = {}  # stamp of the last picture, by stream
        self.records = False  # True while something is recorded

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(FeedbackReceived, self._feedback_received)
        events.subscribe(EventsTraced, self._events_traced)

    def take_frame(self, stream: str, frame: EncodedFrame) -> None:
        """Take a frame that is recorded. Sound has no timing."""
        if not self.records or frame.timing is None or self._newest.get(stream) == frame.stamp:
            return
        self._newest[stream] = frame.stamp
        spans = frame.timing.spans()
        self._put(TraceRecord(epoch=self._clock.epoch, event=frame.stamp, stream=stream, picture=spans))

    def _feedback_received(self, event: FeedbackReceived) -> None:
        if self.records and event.turnaround is not None:
            self._put(TraceRecord(epoch=self._clock.epoch, event=event.feedback.event, command=event.spans))

    def _events_traced(self, traced: EventsTraced) -> None:
        for each in traced.events if self.records else ():
            self._put(
                TraceRecord(
                    epoch=self._clock.epoch,
                    event=each.event,
                    peer=traced.by.peer,
                    name=traced.by.name,
                    command=each.command,
                    stream=each.stream,
                    picture=each.picture,
                )
            )
