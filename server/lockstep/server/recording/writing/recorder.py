"""The recorder: listens to the session on the loop, and hands everything to the thread that writes."""

import asyncio
import secrets
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Literal, Protocol, TypedDict, cast

import structlog

from lockstep.protocol.console import Participants, RecordingState, Report, RobotState, Seat, ServerMessage, SharedNote
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.control.command_arbiter import CommandOutcome as DeskOutcome
from lockstep.server.control.command_arbiter import Forward, Refuse
from lockstep.server.control.session_listener import SessionListener
from lockstep.server.errors import AlreadyRecording, RecordingFailed
from lockstep.server.event_clock import EventClock
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.recorded_encoding import FrameTaker
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import (
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
    StopRecord,
)
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.times import LinkTimes, RecordClock
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, OwnItem, RobotItem
from lockstep.server.recording.writing.writer_thread import RecordingThread

__all__ = ["RecordedMedia", "Recorder"]

log = structlog.get_logger(__name__)

NEWS_SECONDS = 2.0  # between two reports of how much was recorded
RETRY_SECONDS = 15.0  # after a failure, when recording is automatic
PRUNE_TICKS = 30  # reports between two looks at the directory


class _Now(TypedDict):
    epoch: str
    event: int


class RecordedMedia(Protocol):
    """The part of the media hub that the recorder uses."""

    def record(self, take: FrameTaker | None, keyframe_seconds: float) -> None: ...
    def record_keyframes(self) -> None: ...
    def recorded_codecs(self) -> Mapping[str, str]: ...


class Recorder(SessionListener):
    """Records the session. Run `run` as a task; everything but `stop` is called on the loop and returns at once.

    Args:
        clock: the current event
        tell: tells everyone
        signing: signs recordings; None: they are not signed
        audited: called for what nobody asked for, with the action and its recording
    """

    def __init__(
        self,
        settings: RecordingSettings,
        shelf: RecordingStore,
        clock: EventClock,
        media: RecordedMedia,
        tell: Callable[[RecordingState], None],
        signing: RecordingSigning | None = None,
        audited: Callable[[str, str], None] = lambda what, detail: None,
    ) -> None:
        self.shelf = shelf
        self._settings = settings
        self._clock = clock
        self._media = media
        self._tell = tell
        self._signing = signing
        self._audited = audited
        self._role_of: dict[str, str] = {}
        self._times = RecordClock(time.time_ns(), time.monotonic_ns())
        self._link_times = LinkTimes()
        self._link_epoch = ""
        self._robot: RobotState | None = None
        self._seat = Seat()
        self._participants = Participants(participants=[])
        self._thread: RecordingThread | None = None
        self._since = 0.0
        self._failure = ""
        self._again_at = 0.0  # s, monotonic: earliest automatic start
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stopping = asyncio.Lock()
        self._ended = asyncio.Event()  # the thread ended by itself

    async def run(self) -> None:
        """Run until cancelled; the file is closed then."""
        self._loop = asyncio.get_running_loop()
        try:
            self._tell_pruned(await asyncio.to_thread(self._prepare))
            ticks = 0
            while True:
                if self._settings.automatic and self._thread is None and time.monotonic() >= self._again_at:
                    self._try_again()
                try:
                    async with asyncio.timeout(NEWS_SECONDS):
                        await self._ended.wait()
                except TimeoutError:
                    pass
                if self._ended.is_set():
                    self._ended.clear()
                    await self._give_up()
                elif self._thread is not None:
                    self._tell(self.state())
                    ticks += 1
                    if ticks % PRUNE_TICKS == 1:
                        self._tell_pruned(await asyncio.to_thread(self._prune))
        finally:
            await asyncio.shield(self.close())

    def _prepare(self) -> list[str]:
        """Prepare the directory. Return the recordings that were deleted to make room."""
        try:
            self.shelf.prepare()
            self.shelf.recover()
            return self.shelf.prune()
        except OSError as error:
            log.error("the directory of recordings cannot be used", reason=str(error))
            return []

    def _prune(self) -> list[str]:
        """Return the recordings that were deleted to make room. A failure is tried again."""
        try:
            return self.shelf.prune()
        except OSError as error:
            log.error("the directory of recordings cannot be read", reason=str(error))
            return []

    def _tell_pruned(self, gone: list[str]) -> None:
        for recording in gone:
            self._audited("deleted to make room", recording)

    def _try_again(self) -> None:
        try:
            self._audited("started by itself", self.start("", "").recording)
        except RecordingFailed as error:
            self._again_at = time.monotonic() + RETRY_SECONDS
            log.error("the recording cannot start", reason=error.detail)

    # starting and stopping

    def state(self) -> RecordingState:
        """Return the state as everyone is told it."""
        thread = self._thread
        if thread is None:
            return RecordingState(state="failed" if self._failure else "off", detail=self._failure)
        path = thread.path
        return RecordingState(
            state="recording",
            id="" if path is None else path.stem,
            recording=thread.info.recording,
            name=thread.info.name,
            by=thread.info.by,
            since=self._since,
            bytes=thread.bytes_written,
            lost=thread.lost,
            detail="" if path is not None else "waiting for the robot",
        )

    @property
    def automatic(self) -> bool:
        """True if it records without being asked, until somebody ends that."""
        return self._settings.automatic

    @property
    def running(self) -> RecordingThread | None:
        """The thread that writes now; None: nothing is recorded."""
        return self._thread

    def start(self, by: str, name: str) -> RecordingState:
        """Begin a recording.

        Raises:
            AlreadyRecording: one is running.
            RecordingFailed: the directory cannot be used.
        """
        if self._thread is not None:
            raise AlreadyRecording("a recording is running")
        try:
            self.shelf.prepare()
        except OSError as error:
            self._failure = f"{self.shelf.directory}: {error.strerror}"
            self._tell(self.state())
            raise RecordingFailed(self._failure) from error
        self._times = RecordClock(time.time_ns(), time.monotonic_ns())
        self._since, self._failure = round(time.time(), 3), ""
        self._ended.clear()
        thread = RecordingThread(
            self.shelf.directory,
            self._settings,
            RecordingInfo(recording=_fresh_id(), name=name, by=by),
            lambda: self._times.at(time.monotonic()),
            lambda: self._call_soon(self._media.record_keyframes),
            lambda: self._call_soon(self._ended.set),
            self._signing,
        )
        self._thread = thread
        self._put_own(self._participants_record(self._participants))
        self._put_own(self._seat_record(self._seat))
        if self._clock.feedback is not None:
            self._put_feedback(self._clock.feedback, time.monotonic())
        if self._robot is not None:
            self._put_robot(self._robot)
        thread.start()
        self._media.record(self._take_frame, self._settings.keyframe_seconds)
        self._tell(self.state())
        log.info("recording", recording=thread.info.recording, by=by)
        return self.state()

    async def stop(self) -> RecordingState:
        """End the recording, if one is running; returns when the file is closed.

        The state says so when the end of the file could not be written.
        """
        self._settings = self._settings.model_copy(update={"automatic": False})  # ends automatic recording too
        if self._thread is None:
            self._failure = ""
        await self.close()
        self._tell(self.state())
        return self.state()

    async def close(self) -> None:
        """Close the file. Idempotent."""
        async with self._stopping:
            thread = self._thread
            if thread is not None:
                self._media.record(None, self._settings.keyframe_seconds)
                await asyncio.to_thread(thread.close)
                self._thread = None
                self._failure = thread.failure
                log.info("recording ended", recording=thread.info.recording, bytes=thread.bytes_written)

    async def _give_up(self) -> None:
        await self.close()
        if self._failure:
            self._again_at = time.monotonic() + RETRY_SECONDS
            self._audited("failed", self._failure)
            self._tell(self.state())

    def _call_soon(self, call: Callable[[], None]) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(call)

    # SessionListener

    def told(self, message: ServerMessage) -> None:
        match message:
            case RobotState():
                self._robot = message
                if message.epoch != self._link_epoch:
                    self._link_epoch = message.epoch
                    self._link_times = LinkTimes()
                self._put_robot(message)
            case Seat():
                changed = message.holder != self._seat.holder
                self._seat = message
                if changed:
                    self._put_own(self._seat_record(message))
            case Participants():
                self._participants = message
                self._role_of = {each.peer: each.role for each in message.participants}
                self._put_own(self._participants_record(message))
            case SharedNote(peer=peer, name=name, role=role, text=text):
                self._put_own(NoteRecord(**self._now(), peer=peer, name=name, role=role, text=text))

    def command(self, by: Actor, command: Command, outcome: DeskOutcome) -> None:
        if self._thread is None:
            return
        said: CommandOutcome = "repeated"
        reason = ""
        if isinstance(outcome, Forward):
            said, command = "forwarded", outcome.command
        elif isinstance(outcome, Refuse):
            reason = outcome.refusal.reason
            said = "undelivered" if reason == "link_down" else "refused"
        self._put_own(
            CommandRecord(
                epoch=self._clock.epoch,
                event=command.event,
                issue=command.issue,
                values=command.values,
                nonce=command.nonce,
                peer=by.peer,
                name=by.name,
                outcome=said,
                reason=reason,  # type: ignore[arg-type]  # one of RefusalReason, or ""
            )
        )

    def rest(self, by: Actor, rest: Rest, why: str) -> None:
        self._put_own(RestRecord(epoch=self._clock.epoch, event=rest.event, peer=by.peer, why=why))

    def feedback(self, feedback: Feedback, now: float) -> None:
        self._link_times.observe(feedback.time, now)
        self._put_feedback(feedback, now)

    def _put_feedback(self, feedback: Feedback, now: float) -> None:
        captured = self._times.at(self._link_times.captured(feedback.time, now))
        self._put(FeedbackItem(self._times.at(now), captured, self._clock.epoch, feedback))

    def refused(self, to: Actor, refusal: Refusal, by: str) -> None:
        self._put_own(
            RefusalRecord(
                epoch=self._clock.epoch,
                event=refusal.current,
                refused=max(0, refusal.event),
                reason=refusal.reason,
                detail=refusal.detail,
                by=cast(Literal["console", "robot"], by),
                peer=to.peer,
                name=to.name,
            )
        )

    def stop_asked(self, by: Actor, where: str, reason: str, press: str, *, delivered: bool) -> None:
        self._put_own(
            StopRecord(
                **self._now(), kind="stop", by=by.name, where=where, reason=reason, press=press, delivered=delivered
            )
        )

    def stop_taken(self, by: Actor, taken: StopTaken) -> None:
        self._put_own(
            StopRecord(
                **self._now(),
                kind="taken",
                by=by.name,
                where="robot",
                press=taken.press,
                number=taken.number,
                kept=taken.kept,
            )  # fmt: skip
        )

    def reset_done(self, by: Actor, where: str, number: int) -> None:
        self._put_own(StopRecord(**self._now(), kind="reset", by=by.name, where=where, number=number))

    def report(self, by: Actor, report: Report) -> None:
        self._put_own(ReportRecord(**self._now(), peer=by.peer, name=by.name, report=report))

    # handing over to the thread

    def _take_frame(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
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

    def _now(self) -> _Now:
        return {"epoch": self._clock.epoch, "event": self._clock.event}

    def _seat_record(self, seat: Seat) -> OwnRecord:
        role = self._role_of.get(seat.holder, "")
        return SeatRecord(**self._now(), holder=seat.holder, name=seat.name, role=role, why=seat.why)

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
        if self._thread is not None:
            self._thread.put(item)


def _fresh_id() -> str:
    return f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(2)}"
