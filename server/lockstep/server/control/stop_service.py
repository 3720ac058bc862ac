"""Handles STOP at the console: takes it from everybody, keeps it until the bridge confirms it, and resets it.

The rules are in `stop_presses.py`, `reset_attempts.py` and `silenced_links.py`; this module does their I/O.
"""

import asyncio
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

import msgspec
import structlog

from lockstep.protocol.console import Notice
from lockstep.protocol.messages import Refusal, RefusalReason, Reset, Stop, StopState, StopTaken
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor
from lockstep.server.auth.silenced_links import SilencedLinks
from lockstep.server.control.session_listener import SessionListener
from lockstep.server.errors import (
    LinkDown,
    LockedOut,
    NoSeat,
    NotAllowed,
    ResetNotKept,
    ResetTooSoon,
    Silenced,
    StaleReset,
    TooManyRequests,
    Unavailable,
    Unconfirmed,
)
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.stop.reset_attempts import RESET_REASONS, ResetAttempts, ResetOutcome
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import AlreadyTaken, Held, NewPress, Press, Settled, told_id
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["SILENCED", "StopAnswer", "StopOutcome", "StopService", "StopsLink"]

log = structlog.get_logger(__name__)

CONFIRM_SECONDS = 1.0  # wait for the bridge's answer to a press
AGAIN_SECONDS = 0.5  # until an unanswered press is sent again, on a link that is up
WATCH_SECONDS = 0.1  # between two checks, while something is unanswered
MAX_LISTENERS = 16  # connections that are told of one press
PRESSES, PRESS_RATE = 20, 20.0  # Hz, of one link by any path: new ones, and answers to repeats
RECORDS, RECORD_RATE = 5, 0.2  # Hz, of stops of one link, in full and in the log; the audit counts the others
RESETS, RESET_RATE = 5, 1.0  # Hz, of one link
ROBOT_RESETS, ROBOT_RESET_RATE = 10, 2.0  # Hz, of all links together

UNDELIVERED = "The stop was not delivered: there is no link to the robot. The stop is sent first when the link is back."
UNWRITTEN = "Stops cannot be kept on this console's disk ({}). They are kept in memory, until this console ends."
WRITTEN = "Stops can be kept on this console's disk again."
SILENCED = (
    "A supervisor has silenced the STOP of your link, and of all links that you invited with it, for ten minutes. "
    "Robots that you stopped stay stopped."
)
HEARD = "The STOP of your link works again."


class StopsLink(Protocol):
    """The part of the connection to the robot that the service uses."""

    @property
    def up(self) -> bool: ...
    @property
    def detail(self) -> str: ...
    def send(self, message: Reset) -> bool: ...
    def send_stop(self, stop: Stop) -> bool: ...


class StopOutcome(NamedTuple):
    """The outcome of a press, as far as it is known."""

    press: str
    taken: StopTaken | None  # the bridge's answer; None: it has not answered
    detail: str = ""  # why it is not delivered; "" when it is
    released: bool = False  # its stop was reset since

    @property
    def delivered(self) -> bool:
        return self.taken is not None

    @property
    def kept(self) -> bool:
        """True if the stop is on the robot's disk."""
        return self.taken is not None and self.taken.kept

    @property
    def number(self) -> int:
        return 0 if self.taken is None else self.taken.number


class StopAnswer(NamedTuple):
    """The answer to a STOP over HTTP."""

    outcome: StopOutcome
    event: int
    up: bool  # the link to the robot

    def error(self) -> Unavailable:
        """Return the error for a stop that is not delivered."""
        return Unconfirmed(self.outcome.detail) if self.up else LinkDown(self.outcome.detail)


class _Asker(NamedTuple):
    """The sender of a reset, and how it learns the outcome."""

    by: Actor
    where: str
    tell: "Callable[[ResetOutcome[_Asker]], None]"


class StopService:
    """Handles the stops and resets of one robot. Run `run` as a task.

    Everything but `outcome` and `reset` is called on the loop and returns at once.
    """

    def __init__(
        self,
        robot: StopsLink,
        keeper: StopKeeper,
        peers: PeerRegistry,
        clock: EventClock,
        holder: Callable[[], str],
        audit: AuditTrail,
        metrics: Metrics,
        listener: SessionListener,
        silenced: SilencedLinks | None = None,
    ) -> None:
        """`holder`: the peer that holds the control seat, or "". `silenced`: of all robots; None: of this one alone."""
        self._robot = robot
        self._keeper = keeper
        self._presses = keeper.presses
        self._peers = peers
        self._clock = clock
        self._holder = holder
        self._audit = audit
        self._metrics = metrics
        self._listener = listener
        self._silenced = SilencedLinks() if silenced is None else silenced
        self._resets: ResetAttempts[_Asker] = ResetAttempts()
        self._link_resets = RateLimits(RESET_RATE, RESETS)
        self._robot_resets = RateLimits(ROBOT_RESET_RATE, ROBOT_RESETS)
        self._link_presses = RateLimits(PRESS_RATE, PRESSES)
        self._link_repeats = RateLimits(PRESS_RATE, PRESSES)
        self._records = RateLimits(RECORD_RATE, RECORDS)
        self._logged = RateLimits(RECORD_RATE, RECORDS)
        self._listeners: dict[str, list[tuple[str, str]]] = {}  # press -> (waiting peer, id that it knows)
        self._late = {press.id for press in self._presses.pending}  # "not delivered yet" is in the audit
        self._deadlines: dict[str, float] = {}  # press -> end of the wait for its answer
        self._newest: Settled | None = None  # newest stop of this epoch that was sent from here
        self._sent_at = 0.0  # last time that all pending presses were sent
        self._wake = asyncio.Event()
        if self._late:
            self._wake.set()  # another console may have the link for commands: then nothing else sends these
        self._news = asyncio.Event()  # replaced at every answer
        keeper.on_trouble = self._trouble_changed

    @property
    def unconfirmed(self) -> bool:
        """True if a stop is on its way that the robot has not answered."""
        return bool(self._presses.pending)

    @property
    def trouble(self) -> str:
        """The warning to newcomers about the disk; "" when nothing is wrong."""
        return UNWRITTEN.format(self._keeper.trouble) if self._keeper.trouble else ""

    # STOP

    def stop(self, press: Press, given: str = "") -> None:
        """Latch the stop. A repeat has the outcome of the first press with its id. `given`: the id from the sender.

        Raises:
            Silenced: a supervisor has silenced the stops of this link.
        """
        press = msgspec.structs.replace(press, by=self._named(press.by))
        by, where = press.by, press.where
        self._metrics.stops.labels(where).inc()
        if by.link and self._silenced.holds(by.link, time.monotonic()):
            self._audit.refused(by, "silenced")
            raise Silenced(SILENCED)
        if (taken := self._presses.outcome(press.id)) is not None and self._is_released(taken):
            self._presses.forget(press.id)  # the robot may move: it decides whether this is a repeat or a new stop
        rate = self._link_repeats if self._presses.knows(press.id) else self._link_presses
        too_fast = bool(by.link) and not rate.spend(by.link, time.monotonic())
        outcome = self._presses.press(press, hold=too_fast)
        if self._presses.is_pending(press.id) or not too_fast:
            self._listen(by.peer, press.id, told_id(press, given))
        match outcome:
            case AlreadyTaken(taken):
                self._audit.again("stop", by, f"{where}, again")
                self._answer(press.id, taken)  # a sender that repeats too fast sees it in the state of the stop
            case NewPress(_, replaced):
                self._await(press, replaced)
                self._send_new(press)
            case Held(_, replaced):
                self._await(press, replaced)
            case _:
                self._audit.again("stop", by, f"{where}, again")

    def _named(self, by: Actor) -> Actor:
        """Return `by` with its name here, if only one person has the link: a request over HTTP carries no name."""
        if by.peer or not by.link:
            return by
        names = {peer.name for peer in self._peers if peer.identity.token_id == by.link}
        return by._replace(name=names.pop()) if len(names) == 1 else by

    def _await(self, press: Press, replaced: Press | None) -> None:
        """Set a deadline for its answer, after which the press counts as undelivered: silence is not delivery."""
        now = time.monotonic()
        self._deadlines[press.id] = now + CONFIRM_SECONDS
        if len(self._presses.pending) == 1:
            self._sent_at = now
        self._wake.set()
        if replaced is not None:
            self._keeper.settled(replaced.id)
            self._forget_settled()

    def _send_new(self, press: Press) -> None:
        sent = self._robot.send_stop(press.message())
        self._listener.stop_asked(press.by, press.where, press.reason, press.id, delivered=sent)
        if self._logged.spend(press.by.link or press.by.name, time.monotonic()):
            log.warning("stop", by=press.by.name, where=press.where, reason=press.reason, sent=sent)
        if not sent:
            if len(self._presses.pending) == 1:
                self._peers.tell("session", Notice(level="error", text=UNDELIVERED))
            self._not_delivered(press)

    def _forget_settled(self) -> None:
        """Forget presses that are no longer pending: there are so many that some share an outcome."""
        pending = self._presses.is_pending
        self._late = {press for press in self._late if pending(press)}
        self._deadlines = {press: until for press, until in self._deadlines.items() if pending(press)}
        self._listeners = {press: peers for press, peers in self._listeners.items() if pending(press)}

    def _not_delivered(self, press: Press) -> None:
        self._keeper.keep(press)
        self._deadlines.pop(press.id, None)
        if press.id not in self._late:
            self._late.add(press.id)
            self._record(press, f"{press.where}, not delivered yet")

    async def outcome(self, press: str) -> StopOutcome:
        """Return the outcome of a press. Waits a second for the bridge, and for the disk if the robot is away."""
        try:
            async with asyncio.timeout(CONFIRM_SECONDS):
                while (taken := self._presses.outcome(press)) is None and self._robot_may_answer(press):
                    await self._news.wait()
        except TimeoutError:
            taken = None
        if taken is not None:
            return StopOutcome(press, taken, released=self._is_released(taken))
        self._keeper.keep(*(each for each in self._presses.pending if each.id == press))
        kept = await self._keeper.kept_words(press)
        why = "the robot has not confirmed the stop" if self._robot.up else "the robot cannot be reached now"
        return StopOutcome(press, self._presses.outcome(press), f"{why}; {kept}")

    def _is_released(self, taken: StopTaken) -> bool:
        held = self._clock.stop
        return not held.stopped and held.number >= taken.number

    def _robot_may_answer(self, press: str) -> bool:
        return self._robot.up or press not in self._late

    def _listen(self, peer: str, press: str, told: str) -> None:
        """Register `peer` to be told of the robot's answer, by the id that it knows."""
        if not peer:
            return
        listeners = self._listeners.setdefault(press, [])
        if (peer, told) not in listeners and len(listeners) < MAX_LISTENERS:
            listeners.append((peer, told))

    def _answer(self, press: str, taken: StopTaken) -> None:
        for listener, told in self._listeners.pop(press, []):
            peer = self._peers.by_id(listener)
            if peer is not None:
                peer.send("stop", msgspec.structs.replace(taken, press=told))

    # events of the link

    def link_up(self) -> None:
        """Called when some link is up: send all pending presses first, in order."""
        for press in self._presses.pending:
            self._robot.send_stop(press.message())
        self._sent_at = time.monotonic()
        self._wake.set()

    def link_down(self, detail: str) -> None:
        """Called when the link for commands is down: unanswered presses go by the other link, or are kept on disk."""
        for press in self._presses.pending:
            if not self._robot.send_stop(press.message()):
                self._not_delivered(press)
        self._settle(self._resets.link_down(detail))
        self._spread()

    def epoch_ends(self, held: StopState) -> None:
        """Tell the next bridge of a stop that held at the last one, in case it does not remember.

        Also of a stop that the last bridge took, and that no feedback has shown.
        """
        newest, self._newest = self._newest, None
        if held.stopped and held.press:
            by = Actor(held.by)
            self._say_again(Press(id=held.press, by=by, where="epoch", reason=held.reason, time=time.time()))
        if newest is not None and newest.taken.number > held.number:
            self._say_again(newest.press)
        self._settle(self._resets.link_down("the robot bridge has restarted"))

    def _say_again(self, press: Press) -> None:
        if self._presses.again(press):
            self._late.add(press.id)
            self._keeper.keep(press)
            self._wake.set()

    def taken(self, taken: StopTaken) -> None:
        """Take the bridge's answer to a stop."""
        settled = self._presses.taken(taken)
        if settled and (self._newest is None or taken.number > self._newest.taken.number):
            self._newest = settled[0]
        for press, answer in settled:
            self._keeper.settled(press.id)
            self._deadlines.pop(press.id, None)
            late = press.id in self._late
            self._late.discard(press.id)
            more = "" if answer.kept else ", not on the robot's disk"
            more += ", reset before" if self._is_released(answer) else ""
            self._record(press, f"{press.where}{', sent again' if late else ''}, stop {answer.number}{more}")
            self._listener.stop_taken(press.by, answer)
            self._answer(press.id, answer)
        self._spread()

    def feedback(self, stop: StopState) -> None:
        if self._resets:
            self._settle(self._resets.feedback(stop))

    def refused(self, refusal: Refusal) -> bool:
        """Take a refusal of the bridge. True if it refused a reset."""
        outcomes = self._resets.refused(refusal)
        self._settle(outcomes)
        return bool(outcomes) or (not refusal.event and refusal.reason in RESET_REASONS)

    # reset

    async def reset(self, by: Actor, where: str, number: int) -> None:
        """Release stop `number`; returns when the robot says that it is released.

        Raises:
            NotAllowed, NoSeat: neither the holder of the seat nor a supervisor.
            TooManyRequests: of this link, or for this robot.
            StaleReset: another stop is the newest.
            ResetTooSoon, LockedOut, ResetNotKept: as the bridge says.
            LinkDown, Unconfirmed: the robot cannot be told, or has not answered.
        """
        done: asyncio.Future[ResetOutcome[_Asker]] = asyncio.get_running_loop().create_future()

        def tell(outcome: ResetOutcome[_Asker]) -> None:
            if not done.done():
                done.set_result(outcome)

        self._ask_reset(_Asker(by, where, tell), number)
        outcome = await done
        if outcome.reason is not None:
            raise self._reset_error(outcome.reason, outcome.detail)

    def reset_by_peer(self, peer: Peer, number: int) -> None:
        """Release stop `number` for a peer, which is sent a refusal."""

        def tell(outcome: ResetOutcome[_Asker]) -> None:
            if outcome.reason is not None:
                self._metrics.refusals.labels(outcome.reason).inc()
                event = self._clock.event
                refusal = Refusal(
                    event=0, reason=outcome.reason, current=event, detail=outcome.detail[:500], stop=outcome.number
                )
                self._listener.refused(peer.actor, refusal, "console")
                peer.send("stop", refusal)

        self._ask_reset(_Asker(peer.actor, "stop", tell), number)

    def _ask_reset(self, asker: _Asker, number: int) -> None:
        refused = self._refusal_of_reset(asker.by, number)
        if refused is not None:
            self._settle([ResetOutcome(asker, number, *refused)])
            return
        stop = self._clock.stop
        if stop.number == number and not stop.stopped and self._clock.feedback is not None:
            self._settle([ResetOutcome(asker, number, None)])
        elif self._resets.ask(number, asker, time.monotonic()):
            self._wake.set()
            if not self._robot.send(Reset(by=asker.by.name[:500], number=number)):
                self._settle(self._resets.link_down(self._robot.detail))

    def _refusal_of_reset(self, by: Actor, number: int) -> tuple[RefusalReason, str] | None:
        """Return the reason why `by` may not reset now; None: it may."""
        if by.role != "supervisor":
            if by.role == "observer":
                return "not_allowed", "observers may not reset a stop"
            if not self._holds_seat(by):
                return "no_seat", "only the holder of the control seat or a supervisor may reset"
        now = time.monotonic()
        if not (self._link_resets.spend(by.link or by.peer, now) and self._robot_resets.spend("", now)):
            return "too_often", "too many resets with this link or for this robot"
        if not self._robot.up:
            return "link_down", self._robot.detail
        if self._presses.pending:
            return "stale_reset", "a stop is on its way to the robot"
        newest = max(self._clock.stop.number, 0 if self._newest is None else self._newest.taken.number)
        if number < newest:  # also when no feedback has shown it yet
            return "stale_reset", f"the newest stop is number {newest}"
        return None

    def _holds_seat(self, by: Actor) -> bool:
        holder = self._peers.by_id(self._holder()) if self._holder() else None
        if holder is None:
            return False
        return by.peer == holder.id if by.peer else bool(by.link) and by.link == holder.identity.token_id

    def _settle(self, outcomes: list[ResetOutcome[_Asker]]) -> None:
        for outcome in outcomes:
            by, where = outcome.asker.by, outcome.asker.where
            if outcome.reason is None:
                self._metrics.resets.inc()
                self._audit.record("reset", by, where, f"stop {outcome.number}")
                self._listener.reset_done(by, where, outcome.number)
                log.warning("reset", by=by.name, where=where, stop=outcome.number)
            else:
                self._audit.again("reset", by, f"{where}, refused {outcome.reason}")
            outcome.asker.tell(outcome)

    def _reset_error(self, reason: str, detail: str) -> Exception:
        match reason:
            case "not_allowed":
                return NotAllowed(detail)
            case "no_seat":
                return NoSeat(detail)
            case "too_often":
                return TooManyRequests(detail)
            case "too_soon":
                return ResetTooSoon(detail)
            case "locked_out":
                return LockedOut(detail)
            case "stale_reset":
                return StaleReset(detail)
            case "not_kept":
                return ResetNotKept(detail)
            case _:
                return Unconfirmed(detail) if self._robot.up else LinkDown(detail)

    # silence

    def silence(self, by: Peer, peer: str, *, silent: bool) -> RefusalReason | None:
        """Silence the stops of the link of `peer` for a supervisor, or end that. Return a refusal's reason, or None."""
        found = self._peers.by_id(peer)
        if by.role != "supervisor" or found is None or found.role == "supervisor":
            return "not_allowed"
        link, now = found.identity.token_id, time.monotonic()
        if silent:
            self._silenced.silence(link, now)
            self._audit.record("silence", by.actor, "silenced", f"{found.name} ({link})")
        elif self._silenced.hear(link, now):
            self._audit.record("silence", by.actor, "heard again", f"{found.name} ({link})")
        self.show_silence()
        return None

    def show_silence(self) -> None:
        """Tell the peers whose stops were silenced, or are heard again, here or at another robot or console."""
        now = time.monotonic()
        for peer in self._peers:
            silent = self._silenced.holds(peer.identity.token_id, now)
            if silent != peer.silenced:
                peer.silenced = silent
                notice = Notice(level="warning", text=SILENCED) if silent else Notice(level="info", text=HEARD)
                peer.send("session", notice)

    def is_silenced(self, link: str) -> bool:
        return self._silenced.holds(link, time.monotonic())

    # background

    async def run(self) -> None:
        """Act on missing answers until cancelled. Checks at once: an earlier run may have ended by a fault."""
        self._wake.set()
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._look(time.monotonic()):  # noqa: ASYNC110 - deadlines, not a state
                await asyncio.sleep(WATCH_SECONDS)

    def _look(self, now: float) -> bool:
        """Act on missing answers. True if anything is left to wait for."""
        for press in self._presses.take_held():
            self._send_new(press)
        late = [press for press in self._presses.pending if now >= self._deadlines.get(press.id, now + 1)]
        for press in late:
            self._not_delivered(press)
        if late:
            self._spread()
        if now - self._sent_at >= AGAIN_SECONDS and self._presses.pending:
            self.link_up()
        self._settle(self._resets.expire(now))
        return bool(self._presses.pending or self._resets)

    def _record(self, press: Press, what: str) -> None:
        """Record the first stops of each link in full; a flood becomes one record a second."""
        if self._records.spend(press.by.link or press.by.name, time.monotonic()):
            self._audit.record("stop", press.by, what, press.reason)
        else:
            self._audit.again("stop", press.by, f"{press.where}, more")

    def _trouble_changed(self, trouble: str) -> None:
        self._audit.record("stop", what="kept in memory only" if trouble else "kept on disk again", detail=trouble)
        notice = Notice(level="warning", text=self.trouble) if trouble else Notice(level="info", text=WRITTEN)
        self._peers.tell("session", notice)

    def _spread(self) -> None:
        self._news.set()
        self._news = asyncio.Event()
