"""Makes records of where the time of events went (docs/traces.md)."""

from lockstep.server.event_clock import EventClock
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.recording.format.records import TraceRecord
from lockstep.server.recording.writing.record_sink import RecordSink
from lockstep.server.session_events import EventsTraced, FeedbackReceived, SessionEvents

__all__ = ["TraceRecords"]


class TraceRecords:
    """For each event of a recording: spans of the command, of the first picture of each camera, and of the client."""

    def __init__(self, clock: EventClock, sink: RecordSink) -> None:
        self._clock = clock
        self._sink = sink
        self._newest: dict[str, int] = {}  # stamp of the last picture, by stream

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(FeedbackReceived, self._feedback_received)
        events.subscribe(EventsTraced, self._events_traced)

    def take_frame(self, stream: str, frame: EncodedFrame) -> None:
        """Take a frame that is recorded. Sound has no timing."""
        if not self._sink.is_open or frame.timing is None or self._newest.get(stream) == frame.stamp:
            return
        self._newest[stream] = frame.stamp
        spans = frame.timing.spans()
        self._sink.put_own(TraceRecord(epoch=self._clock.epoch, event=frame.stamp, stream=stream, picture=spans))

    def _feedback_received(self, event: FeedbackReceived) -> None:
        if self._sink.is_open and event.turnaround is not None:
            self._sink.put_own(TraceRecord(epoch=self._clock.epoch, event=event.feedback.event, command=event.spans))

    def _events_traced(self, traced: EventsTraced) -> None:
        for each in traced.events if self._sink.is_open else ():
            self._sink.put_own(
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
