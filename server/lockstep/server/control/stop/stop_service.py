"""Handles STOP at the console: takes it from everybody, and keeps it until the bridge confirms it.

The rules are in `stop_presses.py`; this module does their I/O.
"""

import asyncio
import time
from typing import NamedTuple, Protocol

import msgspec
import structlog

from lockstep.protocol.messages import Stop, StopState, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.control.stop.stop_silence import SILENCED, StopSilence
from lockstep.server.errors import RobotLinkDown, Silenced, Unavailable, Unconfirmed
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import (
    SessionEvents,
    StopAnswered,
    StopAsked,
    StopRepeated,
    StopSent,
    StopSilenced,
    StopUndelivered,
)
from lockstep.server.stop.press_deadlines import PressDeadlines
from lockstep.server.stop.press_listeners import PressListeners
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import AlreadyTaken, Held, NewPress, Press, Settled, told_id
from lockstep.server.util.broadcast import Broadcast
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["StopAnswer", "StopOutcome", "StopService", "StopsRobotLink"]

log = structlog.get_logger(__name__)

CONFIRM_SECONDS = 1.0  # wait for the bridge's answer to a press
AGAIN_SECONDS = 0.5  # until an unanswered press is sent again, on a link that is up
WATCH_SECONDS = 0.1  # between two checks, while something is unanswered
PRESSES, PRESS_RATE = 20, 20.0  # Hz, of one link by any path: new ones, and answers to repeats
LINES, LINE_RATE = 5, 0.2  # Hz, of the log, for stops of one link


class StopsRobotLink(Protocol):
    """The part of the connection to the robot that the service uses."""

    @property
    def up(self) -> bool: ...
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
        return Unconfirmed(self.outcome.detail) if self.up else RobotLinkDown(self.outcome.detail)


class StopService:
    """Handles the stops of one robot. Run `run` as a task.

    Everything else but `outcome` is called on the loop and returns at once.
    """

    def __init__(
        self,
        robot: StopsRobotLink,
        keeper: StopKeeper,
        peers: PeerRegistry,
        clock: EventClock,
        silence: StopSilence,
        events: SessionEvents,
    ) -> None:
        self._robot = robot
        self._keeper = keeper
        self._presses = keeper.presses
        self._peers = peers
        self._clock = clock
        self._silence = silence
        self._events = events
        self._link_presses = RateLimits(PRESS_RATE, PRESSES)
        self._link_repeats = RateLimits(PRESS_RATE, PRESSES)
        self._logged = RateLimits(LINE_RATE, LINES)
        self._listeners = PressListeners()
        self._deadlines = PressDeadlines(press.id for press in self._presses.pending)  # late: published as undelivered
        self._newest: Settled | None = None  # newest stop of this epoch that was sent from here
        self._sent_at = 0.0  # last time that all pending presses were sent
        self._wake = asyncio.Event()
        if self._presses.pending:
            self._wake.set()  # another console may have the link for commands: then nothing else sends these
        self._news = Broadcast()  # of answers, and of presses that are late

    @property
    def unconfirmed(self) -> bool:
        """True if a stop is on its way that the robot has not answered."""
        return bool(self._presses.pending)

    @property
    def newest_number(self) -> int:
        """The number of the newest stop of this epoch that was sent from here; 0 before the first."""
        return 0 if self._newest is None else self._newest.taken.number

    def stop(self, press: Press, given: str = "") -> None:
        """Latch the stop. A repeat has the outcome of the first press with its id. `given`: the id from the sender.

        Raises:
            Silenced: a supervisor has silenced the stops of this link.
        """
        press = msgspec.structs.replace(press, by=_named(press.by, self._peers))
        by, where = press.by, press.where
        self._events.publish(StopAsked(by, where))
        if self._silence.holds(by.link):
            self._events.publish(StopSilenced(by))
            raise Silenced(SILENCED)
        if (taken := self._presses.outcome(press.id)) is not None and _is_released(self._clock.stop, taken):
            self._presses.forget(press.id)  # the robot may move: it decides whether this is a repeat or a new stop
        rate = self._link_repeats if self._presses.knows(press.id) else self._link_presses
        too_fast = bool(by.link) and not rate.spend(by.link, time.monotonic())
        outcome = self._presses.press(press, hold=too_fast)
        if self._presses.is_pending(press.id) or not too_fast:
            self._listeners.add(press.id, by.peer, told_id(press, given))
        match outcome:
            case AlreadyTaken(taken):
                self._events.publish(StopRepeated(by, where))
                self._answer(press.id, taken)  # a sender that repeats too fast sees it in the state of the stop
            case NewPress(_, replaced):
                self._await(press, replaced)
                self._send_new(press)
            case Held(_, replaced):
                self._await(press, replaced)
            case _:
                self._events.publish(StopRepeated(by, where))

    def _await(self, press: Press, replaced: Press | None) -> None:
        """Set a deadline for its answer, after which the press counts as undelivered: silence is not delivery."""
        now = time.monotonic()
        self._deadlines.begin(press.id, now + CONFIRM_SECONDS)
        if len(self._presses.pending) == 1:
            self._sent_at = now
        self._wake.set()
        if replaced is not None:
            self._keeper.settled(replaced.id)
            # Some presses are no longer pending: there are so many that some share an outcome.
            self._deadlines.keep(self._presses.is_pending)
            self._listeners.keep(self._presses.is_pending)

    def _send_new(self, press: Press) -> None:
        sent = self._robot.send_stop(press.message())
        self._events.publish(StopSent(press, sent, alone=len(self._presses.pending) == 1))
        if self._logged.spend(press.by.link or press.by.name, time.monotonic()):
            log.warning("stop", by=press.by.name, where=press.where, reason=press.reason, sent=sent)
        if not sent:
            self._not_delivered(press)

    def _not_delivered(self, press: Press) -> None:
        self._keeper.keep(press)
        if self._deadlines.miss(press.id):
            self._events.publish(StopUndelivered(press))

    async def outcome(self, press: str) -> StopOutcome:
        """Return the outcome of a press. Waits a second for the bridge, and for the disk if the robot is away."""
        try:
            async with asyncio.timeout(CONFIRM_SECONDS):
                while (taken := self._presses.outcome(press)) is None:
                    if not self._robot.up and self._deadlines.is_late(press):
                        break  # the robot cannot answer
                    await self._news.wait()
        except TimeoutError:
            taken = None
        if taken is not None:
            return StopOutcome(press, taken, released=_is_released(self._clock.stop, taken))
        self._keeper.keep(*(each for each in self._presses.pending if each.id == press))
        kept = await self._keeper.kept_words(press)
        why = "the robot has not confirmed the stop" if self._robot.up else "the robot cannot be reached now"
        return StopOutcome(press, self._presses.outcome(press), f"{why}; {kept}")

    def _answer(self, press: str, taken: StopTaken) -> None:
        """Tell those who wait for it of the robot's answer, by the id that each knows."""
        for listener, told in self._listeners.take(press):
            peer = self._peers.by_id(listener)
            if peer is not None:
                peer.send("stop", msgspec.structs.replace(taken, press=told))

    # events of the link

    def robot_link_up(self) -> None:
        """Called when some link is up: send all pending presses first, in order."""
        for press in self._presses.pending:
            self._robot.send_stop(press.message())
        self._sent_at = time.monotonic()
        self._wake.set()

    def robot_link_down(self) -> None:
        """Called when the link for commands is down: unanswered presses go by the other link, or are kept on disk."""
        for press in self._presses.pending:
            if not self._robot.send_stop(press.message()):
                self._not_delivered(press)
        self._news.send()

    def epoch_ends(self, held: StopState) -> None:
        """Tell the next bridge of a stop that held at the last one, in case it does not remember.

        Also of a stop that the last bridge took, and that no feedback has shown.
        """
        newest, self._newest = self._newest, None
        told = []
        if held.stopped and held.press:
            by = Actor(held.by)
            told.append(Press(id=held.press, by=by, where="epoch", reason=held.reason, time=time.time()))
        if newest is not None and newest.taken.number > held.number:
            told.append(newest.press)
        for press in told:
            if self._presses.again(press):
                self._deadlines.miss(press.id)
                self._keeper.keep(press)
                self._wake.set()

    def taken(self, taken: StopTaken) -> None:
        """Take the bridge's answer to a stop."""
        settled = self._presses.taken(taken)
        if settled and taken.number > self.newest_number:
            self._newest = settled[0]
        for press, answer in settled:
            self._keeper.settled(press.id)
            late, released = self._deadlines.end(press.id), _is_released(self._clock.stop, answer)
            self._events.publish(StopAnswered(press, answer, again=late, released=released))
            self._answer(press.id, answer)
        self._news.send()

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
        late = self._deadlines.overdue(self._presses.pending, now)
        for press in late:
            self._not_delivered(press)
        if late:
            self._news.send()
        if now - self._sent_at >= AGAIN_SECONDS and self._presses.pending:
            self.robot_link_up()
        return bool(self._presses.pending)


def _named(by: Actor, peers: PeerRegistry) -> Actor:
    """Return `by` with its name here, if only one person has the link: a request over HTTP carries no name."""
    if by.peer or not by.link:
        return by
    names = {peer.name for peer in peers if peer.identity.token_id == by.link}
    return by._replace(name=names.pop()) if len(names) == 1 else by


def _is_released(held: StopState, taken: StopTaken) -> bool:
    return not held.stopped and held.number >= taken.number
