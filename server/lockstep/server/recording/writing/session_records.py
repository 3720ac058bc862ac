"""Turns the events of a session into records, and hands them to the thread that writes."""

import time
from collections.abc import Mapping
from typing import Literal, Protocol, TypedDict

from lockstep.protocol.console import Participants, RobotState, Seat, driver_kind
from lockstep.protocol.messages import Command, Feedback, RefusalReason
from lockstep.server.audit.records import Actor
from lockstep.server.event_clock import EventClock
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.recording.format.drivers import EventDrivers
from lockstep.server.recording.format.records import (
    ActionRecord,
    CommandOutcome,
    CommandRecord,
    NoteRecord,
    OwnRecord,
    ParticipantsRecord,
    RefusalRecord,
    ReportRecord,
    RestRecord,
    RobotRecord,
    SeatRecord,
    ShadowRecord,
    StatusRecord,
    StopRecord,
)
from lockstep.server.recording.times import LinkTimes, RecordClock
from lockstep.server.recording.writing.episode_written import EpisodeWritten
from lockstep.server.recording.writing.map_records import MapRecords
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem, RobotItem
from lockstep.server.recording.writing.trace_records import TraceRecords
from lockstep.server.session_events import (
    ActionAsked,
    ActionCancelled,
    ActionUpdated,
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    FeedbackReceived,
    LinkDown,
    LinkUp,
    MapReceived,
    NavigationReceived,
    NoteWritten,
    ParticipantsChanged,
    Refused,
    ResetDone,
    RestForwarded,
    SeatChanged,
    SessionEvents,
    ShadowJudged,
    SpeedReported,
    StatusReceived,
    StopAnswered,
    StopSent,
)

__all__ = ["SessionRecords"]


class _Now(TypedDict):
    epoch: str
    event: int


class ItemQueue(Protocol):
    """The part of the writing thread that is needed here."""

    def put(self, item: Item) -> None: ...


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
        self._drivers = EventDrivers()
        self._times = RecordClock(time.time_ns(), time.monotonic_ns())
        self._link_times = LinkTimes()
        self._link_epoch = ""
        self._robot: RobotState | None = None
        self._seat = Seat()
        self._seat_role = ""  # of the holder
        self._participants = Participants(participants=[])
        self._queue: ItemQueue | None = None  # None: nothing is recorded
        self._traces = TraceRecords(clock, self._put_own)
        self._maps = MapRecords()

    def begin(self, queue: ItemQueue, times: RecordClock) -> None:
        """Put everything into `queue` from now on, first the state that holds."""
        self._queue, self._times = queue, times
        self._traces.records = True
        self._put_own(self._participants_record(self._participants))
        self._put_own(self._seat_record(self._seat))
        if self._clock.feedback is not None:
            self._put_feedback(self._clock.feedback, time.monotonic())
        if self._robot is not None:
            self._put_robot(self._robot)
        self._maps.begin()
        self._put_maps()

    def end(self) -> None:
        self._queue = None
        self._traces.records = False

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(LinkUp, self._link_changed)
        events.subscribe(LinkDown, self._link_changed)
        events.subscribe(SeatChanged, self._seat_changed)
        events.subscribe(ParticipantsChanged, self._participants_changed)
        events.subscribe(NoteWritten, self._note_written)
        events.subscribe(CommandForwarded, self._command_forwarded)
        events.subscribe(CommandRefused, self._command_refused)
        events.subscribe(CommandRepeated, self._command_repeated)
        events.subscribe(RestForwarded, self._rest_forwarded)
        events.subscribe(FeedbackReceived, self._feedback_received)
        events.subscribe(Refused, self._refused)
        events.subscribe(StopSent, self._stop_sent)
        events.subscribe(StopAnswered, self._stop_answered)
        events.subscribe(ResetDone, self._reset_done)
        events.subscribe(SpeedReported, self._speed_reported)
        events.subscribe(ActionAsked, self._action_asked)
        events.subscribe(ActionCancelled, self._action_cancelled)
        events.subscribe(ActionUpdated, self._action_updated)
        events.subscribe(StatusReceived, self._status_received)
        events.subscribe(MapReceived, self._map_received)
        events.subscribe(NavigationReceived, self._navigation_received)
        events.subscribe(ShadowJudged, self._shadow_judged)
        events.subscribe(EpisodeWritten, self._episode_written)
        self._traces.subscribe(events)

    def _link_changed(self, event: LinkUp | LinkDown) -> None:
        state = event.state
        if state is None:
            return
        self._robot = state
        if state.epoch != self._link_epoch:
            self._link_epoch = state.epoch
            self._link_times = LinkTimes()
            self._maps.forget()
        self._put_robot(state)

    def _seat_changed(self, event: SeatChanged) -> None:
        changed = event.seat.holder != self._seat.holder
        self._seat, self._seat_role = event.seat, event.holder.role
        if changed:
            self._put_own(self._seat_record(event.seat))

    def _participants_changed(self, event: ParticipantsChanged) -> None:
        self._participants = event.participants
        self._put_own(self._participants_record(event.participants))

    def _note_written(self, event: NoteWritten) -> None:
        note = event.note
        self._put_own(NoteRecord(**self._now(), peer=note.peer, name=note.name, role=note.role, text=note.text))

    def _command_forwarded(self, event: CommandForwarded) -> None:
        kind = driver_kind(event.by.role)
        self._drivers.forwarded(self._clock.epoch, event.command.event, event.by.name, kind)
        self._put_command(event.by, event.command, "forwarded")

    def _command_refused(self, event: CommandRefused) -> None:
        outcome: CommandOutcome = "undelivered" if event.reason == "link_down" else "refused"
        self._put_command(event.by, event.command, outcome, event.reason)

    def _command_repeated(self, event: CommandRepeated) -> None:
        self._put_command(event.by, event.command, "repeated")

    def _put_command(
        self, by: Actor, command: Command, outcome: CommandOutcome, reason: RefusalReason | Literal[""] = ""
    ) -> None:
        if self._queue is None:
            return
        self._put_own(
            CommandRecord(
                epoch=self._clock.epoch,
                event=command.event,
                issue=command.issue,
                values=list(command.values),
                nonce=command.nonce,
                action=command.action,
                speed=command.speed,
                peer=by.peer,
                name=by.name,
                outcome=outcome,
                reason=reason,
                kind=driver_kind(by.role),
            )
        )

    def _shadow_judged(self, event: ShadowJudged) -> None:
        verdict = event.verdict
        compared = verdict.difference is not None
        self._put_own(
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

    def _rest_forwarded(self, event: RestForwarded) -> None:
        epoch = self._clock.epoch
        self._put_own(RestRecord(epoch=epoch, event=event.rest.event, peer=event.by.peer, why=event.why))

    def _feedback_received(self, event: FeedbackReceived) -> None:
        self._link_times.observe(event.feedback.time, event.now)
        self._put_feedback(event.feedback, event.now)

    def _put_feedback(self, feedback: Feedback, now: float) -> None:
        driver = self._drivers.executed(self._clock.epoch, feedback.event)
        if self._queue is None:
            return
        captured = self._times.at(self._link_times.captured(feedback.time, now))
        self._put(FeedbackItem(self._times.at(now), captured, self._clock.epoch, feedback, driver))

    def _refused(self, event: Refused) -> None:
        refusal = event.refusal
        self._put_own(
            RefusalRecord(
                epoch=self._clock.epoch,
                event=refusal.current,
                refused=max(0, refusal.event),
                reason=refusal.reason,
                detail=refusal.detail,
                by=event.by,
                peer=event.to.peer,
                name=event.to.name,
            )
        )

    def _stop_sent(self, event: StopSent) -> None:
        press = event.press
        self._put_own(
            StopRecord(
                **self._now(),
                kind="stop",
                by=press.by.name,
                where=press.where,
                reason=press.reason,
                press=press.id,
                delivered=event.delivered,
            )
        )

    def _stop_answered(self, event: StopAnswered) -> None:
        taken = event.taken
        self._put_own(
            StopRecord(
                **self._now(),
                kind="taken",
                by=event.press.by.name,
                where="robot",
                press=taken.press,
                number=taken.number,
                kept=taken.kept,
            )
        )

    def _reset_done(self, event: ResetDone) -> None:
        self._put_own(StopRecord(**self._now(), kind="reset", by=event.by.name, where=event.where, number=event.number))

    def _speed_reported(self, event: SpeedReported) -> None:
        self._put_own(ReportRecord(**self._now(), peer=event.by.peer, name=event.by.name, report=event.report))

    def _action_asked(self, event: ActionAsked) -> None:
        act, by = event.act, event.by
        self._put_own(
            ActionRecord(
                **self._now(),
                id=act.id,
                name=act.name,
                state="asked",
                by=by.name,
                peer=by.peer,
                parameters=act.parameters,
                nonce=act.nonce,
            )
        )

    def _action_cancelled(self, event: ActionCancelled) -> None:
        by = event.by
        self._put_own(ActionRecord(**self._now(), id=event.id, name="", state="cancel", by=by.name, peer=by.peer))

    def _action_updated(self, event: ActionUpdated) -> None:
        update = event.update
        self._put_own(
            ActionRecord(
                epoch=self._clock.epoch,
                event=update.event,
                id=update.id,
                name=update.name,
                state=update.state,
                by=update.by,
                reason=update.reason,
                progress=update.progress,
                text=update.text,
                moves=update.moves,
            )
        )

    def _status_received(self, event: StatusReceived) -> None:
        status = event.status
        self._put_own(StatusRecord(epoch=self._clock.epoch, event=status.event, items=status.items))

    def _map_received(self, event: MapReceived) -> None:
        self._maps.take_map(event.map)
        self._put_maps()

    def _navigation_received(self, event: NavigationReceived) -> None:
        self._maps.take(event.navigation)
        self._put_maps()

    def _put_maps(self) -> None:
        if self._queue is not None:
            for record in self._maps.due(self._clock.epoch, self._clock.event, time.monotonic()):
                self._put_own(record)

    def _episode_written(self, event: EpisodeWritten) -> None:
        record = event.record
        if record.kind != "mark":
            self._drivers.episode(begins=record.kind == "start")
        self._put_own(record)

    # handing over to the thread

    def take_frame(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
        now = time.monotonic()
        captured = min(now, frame.time if attached else self._link_times.captured(frame.time, now))
        self._put(
            MediaItem(
                self._times.at(now),
                self._times.at(captured),
                self._clock.epoch,
                stream,
                codec,
                frame.stamp,
                frame.keyframe,
                frame.data,
            )
        )
        self._traces.take_frame(stream, frame)

    def _now(self) -> _Now:
        return {"epoch": self._clock.epoch, "event": self._clock.event}

    def _seat_record(self, seat: Seat) -> OwnRecord:
        return SeatRecord(**self._now(), holder=seat.holder, name=seat.name, role=self._seat_role, why=seat.why)

    def _participants_record(self, message: Participants) -> OwnRecord:
        return ParticipantsRecord(**self._now(), participants=message.participants)

    def _put_robot(self, state: RobotState) -> None:
        record = RobotRecord(
            epoch=state.epoch,
            event=self._clock.event,
            link=state.link,
            detail=state.detail,
            description=state.description,
        )
        self._put(RobotItem(self._times.at(time.monotonic()), record, self._media.recorded_codecs()))

    def _put_own(self, record: OwnRecord) -> None:
        self._put(OwnItem(self._times.at(time.monotonic()), record))

    def _put(self, item: Item) -> None:
        if self._queue is not None:
            self._queue.put(item)
