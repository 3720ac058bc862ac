"""Runs the episodes of a robot's session: takes requests, writes records, tells everyone, and lets time pass."""

import asyncio
import math
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Protocol

from lockstep.protocol.console import Seat
from lockstep.protocol.episodes import (
    EpisodeAnswer,
    EpisodeReason,
    EpisodeRequest,
    EpisodeState,
)
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.recording.episodes.episode_core import (
    CutReason,
    Effect,
    Ended,
    EpisodeCore,
    EpisodeRefused,
    RunReset,
    Write,
)
from lockstep.server.recording.episodes.open_episode import Place
from lockstep.server.recording.episodes.reset_action import ResetAction
from lockstep.server.recording.episodes.session_checks import CheckedRobot, SessionChecks
from lockstep.server.recording.episodes.settings import EpisodeSettings
from lockstep.server.recording.format.records import EpisodeRecord
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.episode_written import EpisodeEnded, EpisodeWritten
from lockstep.server.recording.writing.recorder import Recorder
from lockstep.server.session_events import (
    ActionUpdated,
    EpisodeAsked,
    EpochBegan,
    FeedbackReceived,
    LinkDown,
    ResetDone,
    SeatChanged,
    SessionEvents,
    StopShown,
)
from lockstep.server.util.display_names import printable
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["EpisodeRobot", "EpisodeService"]

TICK_SECONDS = 0.1
CHECK_TICKS = 5  # between two looks at what may spoil the episode
NEWS_TICKS = 10  # between two messages while an episode is open
ASKS, ASK_RATE = 20, 4.0  # Hz, of one link

Answer = Callable[[EpisodeReason, str, str], None]  # reason, detail, episode


class EpisodeRobot(CheckedRobot, Protocol):
    """The part of the connection to the robot that is needed here."""

    @property
    def up(self) -> bool: ...


class EpisodeService:
    """Run `run` as a task. All other methods are called on the loop and return at once, but for `ask_by_http`."""

    def __init__(
        self,
        settings: EpisodeSettings,
        recording: RecordingSettings,
        clock: EventClock,
        events: SessionEvents,
        recorder: Recorder,
        recorded: Callable[[], Mapping[str, str]],
        robot: EpisodeRobot,
        reset: ResetAction,
        may_ask: Callable[[Actor], bool],
        has_ended: Callable[[str, float], bool],
        peers: PeerRegistry,
        audit: AuditTrail,
    ) -> None:
        """Create the service.

        Args:
            events: get the records of episodes
            recorded: returns codec by stream of what is recorded
            may_ask: returns whether a person may begin and end episodes
            has_ended: returns whether the link with this id and expiry is no longer good
        """
        self._clock = clock
        self._events = events
        self._recorder = recorder
        self._robot = robot
        self._reset = reset
        self._may_ask = may_ask
        self._has_ended = has_ended
        self._begins_for = "", 0.0  # id and expiry of the link that asked for the episode that is about to begin
        self._peers = peers
        self._audit = audit
        self._core = EpisodeCore(
            lambda: secrets.token_hex(8),
            countdown=settings.countdown_seconds,
            resets=reset.is_wanted,
            reset_seconds=settings.reset_seconds,
        )
        self._checks = SessionChecks(robot, recorder, recorded, recording.free_bytes)
        self._seat = Seat()
        self._stop_number, self._is_stopped = 0, False
        self._since = 0.0  # s since 1970
        self._asks = RateLimits(ASK_RATE, ASKS)
        self._newest_event = 0  # also after the epoch's end
        self._waiting: list[tuple[str, Answer]] = []  # for an episode to be on the disk
        recorder.watched_by(self)

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(EpisodeAsked, self._asked)
        events.subscribe(SeatChanged, self._seat_changed)
        events.subscribe(StopShown, self._stop_shown)
        events.subscribe(ResetDone, lambda event: self._noted(f"stop {event.number} was reset by {event.by.name}"))
        events.subscribe(FeedbackReceived, self._fed_back)
        events.subscribe(EpochBegan, lambda event: self._cut("epoch"))
        events.subscribe(LinkDown, lambda event: self._cut("link_down"))
        events.subscribe(ActionUpdated, self._reset.updated)

    async def run(self) -> None:
        """Let time pass, until cancelled."""
        ticks = 0
        try:
            while True:
                await asyncio.sleep(TICK_SECONDS)
                ticks += 1
                phase = self._core.phase
                if self._core.is_about_to_begin and self._has_ended(*self._begins_for):
                    self._core.cancel("the link that asked for it has ended")
                    self._tell()
                if phase in ("countdown", "resetting"):
                    self._act(self._core.tick(self._place(), time.monotonic()), before=phase)
                if self._core.phase == "resetting" and (ended := self._reset.ended()) is not None:
                    self._act(self._core.reset_ended(ended, self._place(), time.monotonic()), before="resetting")
                if self._core.phase == "open" and ticks % CHECK_TICKS == 0:
                    changed = self._check()
                    if changed or ticks % NEWS_TICKS == 0:
                        self._tell()
        finally:
            self._act(self._core.cut("console_ended", self._place()), tells=False)

    def state(self) -> EpisodeState:
        """Return the state as everyone is told it."""
        core = self._core
        return EpisodeState(
            phase=core.phase,
            episode=core.episode,
            number=core.number,
            task=core.task,
            by=core.by,
            seconds_left=round(core.seconds_left(time.monotonic()), 1),
            since=self._since if core.episode else 0.0,
            first_event=core.first_event,
            kept=core.kept,
            discarded=core.discarded,
            cut=core.cuts,
            last=core.last,
            reset_action=self._reset.name,
            problems=self._checks.problems if core.phase == "open" else [],
        )

    # requests

    def _asked(self, event: EpisodeAsked) -> None:
        peer, request = self._peers.by_id(event.by.peer), event.request

        def answer(reason: EpisodeReason, detail: str, episode: str) -> None:
            if peer is not None:
                peer.send("session", EpisodeAnswer(id=request.id, reason=reason, detail=detail, episode=episode))

        self._ask(event.by, math.inf if peer is None else peer.identity.expires, request, answer)

    async def ask_by_http(self, by: Actor, expires: float, request: EpisodeRequest) -> EpisodeState:
        """Do what is asked for by a link that `expires` (s since 1970); return the state when it is done.

        Raises:
            EpisodeRefused: it is not done.
        """
        done: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        def answer(reason: EpisodeReason, detail: str, episode: str) -> None:
            if done.done():
                return
            if reason:
                done.set_exception(EpisodeRefused(reason, detail))
            else:
                done.set_result(None)

        self._ask(by, expires, request, answer)
        await done
        return self.state()

    def _ask(self, by: Actor, expires: float, request: EpisodeRequest, answer: Answer) -> None:
        episode = self._core.episode
        try:
            if not self._may_ask(by):
                raise EpisodeRefused("not_allowed", "the holder of the seat and supervisors may do this")
            if not self._asks.spend(by.link or by.name, time.monotonic()):
                raise EpisodeRefused("too_often")
            effects = self._decide(by, request)
        except EpisodeRefused as refused:
            answer(refused.reason, refused.detail, episode)
            return
        if request.do == "keep":
            self._waiting.append((episode, answer))
        if request.do in ("start", "redo"):
            self._begins_for = by.link, expires
        self._act(effects)
        if request.do != "mark":
            what = f"episode: {request.do} {request.outcome}".strip()
            self._audit.record("recording", by, what, self._core.episode or episode)
        if request.do != "keep":
            answer("", "", self._core.episode or episode)

    def _decide(self, by: Actor, request: EpisodeRequest) -> list[Effect]:
        core, place, now = self._core, self._place(), time.monotonic()
        match request.do:
            case "start":
                return core.start(printable(request.task), by.name, place, now)
            case "keep":
                return core.keep(request.episode, request.outcome, by.name, place)
            case "discard":
                return core.discard(request.episode, by.name, place, now)
            case "redo":
                return core.redo(request.episode, by.name, place, now)
            case "mark":
                return core.mark(request.episode, printable(request.text), by.name, place)

    # RecordingWatcher

    def recording_ends(self, failure: str) -> None:
        self._cut("recording_failed" if failure else "recording_ended")

    def episode_written(self, episode: str, kept: bool) -> None:
        before = self._core.phase
        if episode != self._core.episode:
            return
        if kept:
            self._act(self._core.on_disk(episode, time.monotonic()), before=before)
            self._answer_waiting(episode, "", "")
        else:
            self._cut("new_part")

    def picture_recorded(self, stream: str, stamp: int) -> None:
        self._checks.picture(stream, stamp)

    # events of the session

    def _fed_back(self, event: FeedbackReceived) -> None:
        self._newest_event = event.feedback.event

    def _seat_changed(self, event: SeatChanged) -> None:
        before, self._seat = self._seat, event.seat
        if event.seat.holder != before.holder:
            self._noted(f"{event.seat.name or 'nobody'} drives ({event.seat.why})")

    def _stop_shown(self, event: StopShown) -> None:
        stop = event.stop
        if stop.stopped and (not self._is_stopped or stop.number > self._stop_number):
            self._noted(f"stop {stop.number} by {stop.by or 'somebody'}: {stop.reason}".rstrip(": "))
        self._is_stopped, self._stop_number = stop.stopped, stop.number

    def _noted(self, text: str) -> None:
        self._act(self._core.noted(text, self._place()), tells=False)

    def _cut(self, why: CutReason) -> None:
        episode, before = self._core.episode, self._core.phase
        place = self._place()
        if why == "epoch":
            place = place._replace(event=self._newest_event or place.event)
        self._act(self._core.cut(why, place), before=before)
        if self._core.episode != episode:
            self._answer_waiting(episode, "not_written", self._core.last)

    # acting

    def _act(self, effects: list[Effect], *, before: str | None = None, tells: bool = True) -> None:
        """Carry out effects. `before`: tell everyone only if the phase is another one now."""
        for effect in effects:
            match effect:
                case Write(record):
                    self._write(record)
                case RunReset():
                    self._reset.begin()
                case Ended(end):
                    self._events.publish(EpisodeEnded(end))
        if tells and (before is None or before != self._core.phase):
            self._tell()

    def _write(self, record: EpisodeRecord) -> None:
        self._events.publish(EpisodeWritten(record))
        if record.kind != "start":
            return
        self._since = round(time.time(), 3)
        self._checks.begin(record.event)

    def _check(self) -> bool:
        """Return True if something else spoils the episode than before."""
        changed = self._checks.look(self._clock.event)
        for each in self._checks.problems:
            self._core.spoiled(f"{each.kind} {each.stream}".strip())
        return changed

    def _answer_waiting(self, episode: str, reason: EpisodeReason, detail: str) -> None:
        mine = [answer for each, answer in self._waiting if each == episode]
        self._waiting = [each for each in self._waiting if each[0] != episode]
        for answer in mine:
            answer(reason, detail, episode)

    def _tell(self) -> None:
        self._peers.announce(self.state())

    def _place(self) -> Place:
        thread = self._recorder.running
        recording = "" if thread is None or not thread.running else thread.info.recording
        return Place(self._clock.epoch, self._clock.event, recording, self._robot.up, self._seat.name)
