"""Runs the episodes of a robot's session: takes requests, writes records, tells everyone, and lets time pass."""

import asyncio
import math
import secrets
import time
from collections.abc import Callable, Mapping

from lockstep.protocol.episodes import (
    EpisodeAnswer,
    EpisodeCut,
    EpisodeReason,
    EpisodeRequest,
    EpisodeState,
)
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.recording.episodes.episode_before import EpisodeBefore
from lockstep.server.recording.episodes.episode_core import (
    Effect,
    Ended,
    EpisodeCore,
    EpisodeRefused,
    RunReset,
    Write,
)
from lockstep.server.recording.episodes.open_episode import Place
from lockstep.server.recording.episodes.reset_action import ResetAction
from lockstep.server.recording.episodes.session_checks import SessionChecks
from lockstep.server.recording.episodes.session_place import EpisodeRobot, SessionPlace
from lockstep.server.recording.episodes.settings import EpisodeSettings
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.episode_written import EpisodeEnded, EpisodeWritten
from lockstep.server.recording.writing.recorder import Recorder
from lockstep.server.session_events import (
    ActionUpdated,
    EpisodeAsked,
    EpochBegan,
    FeedbackReceived,
    ResetDone,
    RobotLinkDown,
    SeatChanged,
    SessionEvents,
    StopShown,
)
from lockstep.server.util.display_names import printable
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["EpisodeService"]

TICK_SECONDS = 0.1
CHECK_TICKS = 5  # between two looks at what may spoil the episode
NEWS_TICKS = 10  # between two messages while an episode is open
ASKS, ASK_RATE = 20, 4.0  # Hz, of one link

Answer = Callable[[EpisodeReason, str, str], None]  # reason, detail, episode


class _WaitingForDisk:
    """Who is answered when an episode is on the disk, or cannot be."""

    def __init__(self) -> None:
        self._waiting: list[tuple[str, Answer]] = []

    def add(self, episode: str, answer: Answer) -> None:
        self._waiting.append((episode, answer))

    def answer(self, episode: str, reason: EpisodeReason, detail: str) -> None:
        mine = [answer for each, answer in self._waiting if each == episode]
        self._waiting = [each for each in self._waiting if each[0] != episode]
        for answer in mine:
            answer(reason, detail, episode)


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
        self._place = SessionPlace(clock, recorder, robot)
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
        self._since = 0.0  # s since 1970
        self._reads_recordings = True  # of earlier processes
        self._asks = RateLimits(ASK_RATE, ASKS)
        self._waiting = _WaitingForDisk()
        recorder.watched_by(self)

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(EpisodeAsked, self._asked)
        events.subscribe(SeatChanged, self._happened)
        events.subscribe(StopShown, self._happened)
        events.subscribe(ResetDone, self._happened)
        events.subscribe(FeedbackReceived, self._place.fed_back)
        events.subscribe(EpochBegan, lambda event: self._cut("epoch"))
        events.subscribe(RobotLinkDown, lambda event: self._cut("link_down"))
        events.subscribe(ActionUpdated, self._reset.updated)

    async def run(self) -> None:
        """Let time pass, until cancelled."""
        ticks = 0
        try:
            while True:
                await asyncio.sleep(TICK_SECONDS)
                ticks += 1
                phase = self._core.phase
                if self._core.next.wanted is not None and self._has_ended(*self._begins_for):
                    self._core.next.cancel("the link that asked for it has ended")
                    self._tell()
                if phase in ("countdown", "resetting"):
                    self._act(self._core.tick(self._place.now(), time.monotonic()), before=phase)
                if self._core.phase == "resetting" and (ended := self._reset.ended()) is not None:
                    self._act(self._core.reset_ended(ended, self._place.now(), time.monotonic()), before="resetting")
                if self._core.phase in ("countdown", "resetting", "keeping") and ticks % NEWS_TICKS == 0:
                    self._tell()  # who waits knows that the console still counts
                current = self._core.current if self._core.phase == "open" else None
                if current is not None and ticks % CHECK_TICKS == 0:
                    changed = self._checks.look(self._clock.event, current)
                    if changed or ticks % NEWS_TICKS == 0:
                        self._tell()
        finally:
            self._act(self._core.cut("console_ended", self._place.now()), tells=False)

    def state(self) -> EpisodeState:
        """Return the state as everyone is told it."""
        core, current, history = self._core, self._core.current, self._core.history
        return EpisodeState(
            phase=core.phase,
            episode=core.episode,
            number=history.number,
            task=core.task,
            by=core.by,
            seconds_left=round(core.next.seconds_left(time.monotonic()), 1),
            since=0.0 if current is None else self._since,
            first_event=0 if current is None else current.first_event,
            kept=history.kept,
            discarded=history.discarded,
            cut=history.cuts,
            last=history.last,
            last_episode=history.last_id,
            lost=history.lost,
            reads_recordings=self._reads_recordings,
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
            effects = _decide(self._core, request, by.name, self._place.now(), time.monotonic())
        except EpisodeRefused as refused:
            answer(refused.reason, refused.detail, episode)
            return
        if request.do == "keep":
            self._waiting.add(episode, answer)
        if request.do in ("start", "redo"):
            self._begins_for = by.link, expires
        self._act(effects)
        if request.do != "mark":
            what = f"episode: {request.do} {request.outcome}".strip()
            self._audit.record("recording", by, what, self._core.episode or episode)
        if request.do != "keep":
            answer("", "", self._core.episode or episode)

    # RecordingWatcher

    def recordings_read(self, earlier: EpisodeBefore | None) -> None:
        self._reads_recordings = False
        if earlier is not None:
            self._core.history.begin_after(earlier.id, earlier.number, earlier.state, earlier.why)
            self._core.task = self._core.task or printable(earlier.task)
        self._tell()

    def recording_ends(self, failure: str) -> None:
        self._cut("recording_failed" if failure else "recording_ended")

    def episode_written(self, episode: str, kept: bool) -> None:
        before = self._core.phase
        if episode != self._core.episode:
            return
        if kept:
            self._act(self._core.on_disk(episode, time.monotonic()), before=before)
            self._waiting.answer(episode, "", "")
        else:
            self._cut("new_part")

    def picture_recorded(self, stream: str, stamp: int) -> None:
        self._checks.picture(stream, stamp)

    # events of the session

    def _happened(self, event: SeatChanged | StopShown | ResetDone) -> None:
        if text := self._place.note(event):
            self._act(self._core.noted(text, self._place.now()), tells=False)

    def _cut(self, why: EpisodeCut) -> None:
        episode, before = self._core.episode, self._core.phase
        place = self._place.at_epoch_end() if why == "epoch" else self._place.now()
        self._act(self._core.cut(why, place), before=before)
        if self._core.episode != episode:
            self._waiting.answer(episode, "not_written", self._core.history.last)

    # acting

    def _act(self, effects: list[Effect], *, before: str | None = None, tells: bool = True) -> None:
        """Carry out effects. `before`: tell everyone only if the phase is another one now."""
        for effect in effects:
            match effect:
                case Write(record):
                    self._events.publish(EpisodeWritten(record))
                    if record.kind == "start":
                        self._since = round(time.time(), 3)
                        self._checks.begin(record.event)
                case RunReset():
                    self._reset.begin()
                case Ended(end):
                    self._events.publish(EpisodeEnded(end))
        if tells and (before is None or before != self._core.phase):
            self._tell()

    def _tell(self) -> None:
        self._peers.announce(self.state())


def _decide(core: EpisodeCore, request: EpisodeRequest, by: str, place: Place, now: float) -> list[Effect]:
    match request.do:
        case "start":
            return core.start(printable(request.task), by, place, now)
        case "keep":
            return core.keep(request.episode, request.outcome, by, place)
        case "discard":
            return core.discard(request.episode, by, place, now)
        case "redo":
            return core.redo(request.episode, by, place, now)
        case "mark":
            return core.mark(request.episode, printable(request.text), by, place)
