"""Turns the events of a session into records, and hands them to the thread that writes."""

import time
from collections.abc import Mapping
from typing import Protocol

from lockstep.protocol.console import Participants, RobotState, Seat, driver_kind
from lockstep.protocol.messages import Feedback
from lockstep.server.audit.records import Actor
from lockstep.server.event_clock import EventClock
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.recording.format.drivers import EventDrivers
from lockstep.server.recording.format.records import RobotRecord, ShadowRecord
from lockstep.server.recording.times import RecordClock, RobotLinkTimes
from lockstep.server.recording.writing.episode_written import EpisodeWritten
from lockstep.server.recording.writing.event_records import RecordedEvent, record_of
from lockstep.server.recording.writing.map_records import MapRecords
from lockstep.server.recording.writing.queue_items import FeedbackItem, MediaItem, RobotItem
from lockstep.server.recording.writing.record_sink import ItemQueue, RecordSink
from lockstep.server.recording.writing.trace_records import TraceRecords
from lockstep.server.session_events import (
    ActionAsked,
    ActionCancelled,
    ActionUpdated,
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    FeedbackReceived,
    NoteWritten,
    ParticipantsChanged,
    Refused,
    ResetDone,
    RestForwarded,
    RobotLinkDown,
    RobotLinkUp,
    SeatChanged,
    SessionEvents,
    ShadowJudged,
    SpeedReported,
    StatusReceived,
    StopAnswered,
    StopSent,
)

__all__ = ["SessionRecords"]


class RecordedCodecs(Protocol):
    """The part of the media hub that is needed here."""

    def recorded_codecs(self) -> Mapping[str, str]: ...


class SessionRecords:
    """A subscriber to the events of a session. Between `begin` and `end` it makes records of them.

    It always knows the newest state of robot, seat and participants, with which each recording begins.
    """

    def __init__(self, clock: EventClock, media: RecordedCodecs) -> None:
        self._clock = clock
        self._media = media
        self._sink = RecordSink()
        self._drivers = EventDrivers()
        self._robot_link_times = RobotLinkTimes()
        self._robot_link_epoch = ""
        self._robot: RobotState | None = None
        self._seat = SeatChanged(Seat(), Actor(), Actor())
        self._participants = ParticipantsChanged(Participants(participants=[]))
        self._traces = TraceRecords(clock, self._sink)
        self._maps = MapRecords(clock, self._sink)

    def begin(self, queue: ItemQueue, times: RecordClock) -> None:
        """Put everything into `queue` from now on, first the state that holds."""
        self._sink.open(queue, times)
        self._happened(self._participants)
        self._happened(self._seat)
        if self._clock.feedback is not None:
            self._put_feedback(self._clock.feedback, time.monotonic())
        if self._robot is not None:
            self._put_robot(self._robot)
        self._maps.begin()

    def end(self) -> None:
        self._sink.close()

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(RobotLinkUp, self._robot_link_changed)
        events.subscribe(RobotLinkDown, self._robot_link_changed)
        events.subscribe(SeatChanged, self._seat_changed)
        events.subscribe(ParticipantsChanged, self._participants_changed)
        events.subscribe(NoteWritten, self._happened)
        events.subscribe(CommandForwarded, self._command_forwarded)
        events.subscribe(CommandRefused, self._happened)
        events.subscribe(CommandRepeated, self._happened)
        events.subscribe(RestForwarded, self._happened)
        events.subscribe(FeedbackReceived, self._feedback_received)
        events.subscribe(Refused, self._happened)
        events.subscribe(StopSent, self._happened)
        events.subscribe(StopAnswered, self._happened)
        events.subscribe(ResetDone, self._happened)
        events.subscribe(SpeedReported, self._happened)
        events.subscribe(ActionAsked, self._happened)
        events.subscribe(ActionCancelled, self._happened)
        events.subscribe(ActionUpdated, self._happened)
        events.subscribe(StatusReceived, self._happened)
        events.subscribe(ShadowJudged, self._shadow_judged)
        events.subscribe(EpisodeWritten, self._episode_written)
        self._maps.subscribe(events)
        self._traces.subscribe(events)

    def _happened(self, event: RecordedEvent) -> None:
        if self._sink.is_open:
            self._sink.put_own(record_of(event, self._clock.epoch, self._clock.event))

    def _robot_link_changed(self, event: RobotLinkUp | RobotLinkDown) -> None:
        state = event.state
        if state is None:
            return
        self._robot = state
        if state.epoch != self._robot_link_epoch:
            self._robot_link_epoch = state.epoch
            self._robot_link_times = RobotLinkTimes()
            self._maps.forget()
        self._put_robot(state)

    def _seat_changed(self, event: SeatChanged) -> None:
        before, self._seat = self._seat, event
        if event.seat.holder != before.seat.holder:
            self._happened(event)

    def _participants_changed(self, event: ParticipantsChanged) -> None:
        self._participants = event
        self._happened(event)

    def _command_forwarded(self, event: CommandForwarded) -> None:
        kind = driver_kind(event.by.role)
        self._drivers.forwarded(self._clock.epoch, event.command.event, event.by.name, kind)
        self._happened(event)

    def _shadow_judged(self, event: ShadowJudged) -> None:
        verdict = event.verdict
        compared = verdict.difference is not None
        self._sink.put_own(
            ShadowRecord(
                epoch=self._clock.epoch,
                event=verdict.event,
                peer=verdict.peer,
                name=verdict.name,
                values=verdict.values,
                judgement=verdict.judgement,
                difference=verdict.difference,
                driver_kind=self._drivers.executed(self._clock.epoch, verdict.event).kind if compared else "none",
            )
        )

    def _feedback_received(self, event: FeedbackReceived) -> None:
        self._robot_link_times.observe(event.feedback.time, event.now)
        self._put_feedback(event.feedback, event.now)

    def _put_feedback(self, feedback: Feedback, now: float) -> None:
        driver = self._drivers.executed(self._clock.epoch, feedback.event)
        if not self._sink.is_open:
            return
        times = self._sink.times
        captured = times.at(self._robot_link_times.captured(feedback.time, now))
        self._sink.put(FeedbackItem(times.at(now), captured, self._clock.epoch, feedback, driver))

    def _episode_written(self, event: EpisodeWritten) -> None:
        if event.record.kind != "mark":
            self._drivers.episode(begins=event.record.kind == "start")
        self._happened(event)

    def take_frame(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
        now, times = time.monotonic(), self._sink.times
        captured = min(now, frame.time if attached else self._robot_link_times.captured(frame.time, now))
        self._sink.put(
            MediaItem(
                times.at(now),
                times.at(captured),
                self._clock.epoch,
                stream,
                codec,
                frame.stamp,
                frame.keyframe,
                frame.data,
            )
        )
        self._traces.take_frame(stream, frame)

    def _put_robot(self, state: RobotState) -> None:
        record = RobotRecord(
            epoch=state.epoch,
            event=self._clock.event,
            link=state.link,
            detail=state.detail,
            description=state.description,
        )
        self._sink.put(RobotItem(self._sink.times.at(time.monotonic()), record, self._media.recorded_codecs()))
