"""Handles the resets of one robot: checks the right to reset, sends the reset, and tells the sender its outcome.

The rules of an attempt are in `reset_attempts.py`; this module does their I/O.
"""

import asyncio
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

import structlog

from lockstep.protocol.console import PEOPLE
from lockstep.protocol.messages import Refusal, RefusalReason, Reset, StopState
from lockstep.server.audit.records import Actor
from lockstep.server.errors import (
    LockedOut,
    NoSeat,
    NotAllowed,
    ResetNotKept,
    ResetTooSoon,
    RobotLinkDown,
    StaleReset,
    TooManyRequests,
    Unconfirmed,
)
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import Refused, ResetDone, ResetRefused, SessionEvents
from lockstep.server.stop.reset_attempts import RESET_REASONS, ResetAttempts, ResetOutcome
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["ResetService"]

log = structlog.get_logger(__name__)

WATCH_SECONDS = 0.1  # between two checks, while a reset is unanswered
RESETS, RESET_RATE = 5, 1.0  # Hz, of one link
ROBOT_RESETS, ROBOT_RESET_RATE = 10, 2.0  # Hz, of all links together


class ResetsRobotLink(Protocol):
    """The part of the connection to the robot that the service uses."""

    @property
    def up(self) -> bool: ...
    @property
    def detail(self) -> str: ...
    def send(self, message: Reset) -> bool: ...


class TakenStops(Protocol):
    """The part of the STOP service that the service uses."""

    @property
    def unconfirmed(self) -> bool: ...
    @property
    def newest_number(self) -> int: ...


class SeatHolder(Protocol):
    @property
    def holder(self) -> str:
        """The peer that holds the control seat, or ""."""
        ...


class _Asker(NamedTuple):
    """The sender of a reset, and how it learns the outcome."""

    by: Actor
    where: str
    tell: "Callable[[ResetOutcome[_Asker]], None]"


class ResetService:
    """Run `run` as a task. Everything else but `reset` is called on the loop and returns at once."""

    def __init__(
        self,
        robot: ResetsRobotLink,
        stops: TakenStops,
        peers: PeerRegistry,
        clock: EventClock,
        seat: SeatHolder,
        events: SessionEvents,
    ) -> None:
        self._robot = robot
        self._stops = stops
        self._peers = peers
        self._clock = clock
        self._seat = seat
        self._events = events
        self._attempts: ResetAttempts[_Asker] = ResetAttempts()
        self._of_link = RateLimits(RESET_RATE, RESETS)
        self._of_robot = RateLimits(ROBOT_RESET_RATE, ROBOT_RESETS)
        self._wake = asyncio.Event()

    async def reset(self, by: Actor, where: str, number: int) -> None:
        """Release stop `number`; returns when the robot says that it is released.

        Raises:
            NotAllowed, NoSeat: neither the holder of the seat nor a supervisor.
            TooManyRequests: of this link, or for this robot.
            StaleReset: another stop is the newest.
            ResetTooSoon, LockedOut, ResetNotKept: as the bridge says.
            RobotLinkDown, Unconfirmed: the robot cannot be told, or has not answered.
        """
        done: asyncio.Future[ResetOutcome[_Asker]] = asyncio.get_running_loop().create_future()

        def tell(outcome: ResetOutcome[_Asker]) -> None:
            if not done.done():
                done.set_result(outcome)

        self._ask(_Asker(by, where, tell), number)
        outcome = await done
        if outcome.reason is not None:
            raise self._error(outcome.reason, outcome.detail)

    def reset_by_peer(self, peer: Peer, number: int) -> None:
        """Release stop `number` for a peer, which is sent a refusal."""

        def tell(outcome: ResetOutcome[_Asker]) -> None:
            if outcome.reason is not None:
                event = self._clock.event
                refusal = Refusal(
                    event=0, reason=outcome.reason, current=event, detail=outcome.detail[:500], stop=outcome.number
                )
                peer.send("stop", refusal)
                self._events.publish(Refused(peer.actor, "stop", refusal, "console"))

        self._ask(_Asker(peer.actor, "stop", tell), number)

    def robot_link_down(self, detail: str) -> None:
        """Called when the link for commands is down, or another bridge has begun."""
        self._settle(self._attempts.robot_link_down(detail))

    def feedback(self, stop: StopState) -> None:
        if self._attempts:
            self._settle(self._attempts.feedback(stop))

    def refused(self, refusal: Refusal) -> bool:
        """Take a refusal of the bridge. True if it refused a reset."""
        outcomes = self._attempts.refused(refusal)
        self._settle(outcomes)
        return bool(outcomes) or (not refusal.event and refusal.reason in RESET_REASONS)

    async def run(self) -> None:
        """Act on missing answers until cancelled. Checks at once: an earlier run may have ended by a fault."""
        self._wake.set()
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._attempts:
                await asyncio.sleep(WATCH_SECONDS)
                self._settle(self._attempts.expire(time.monotonic()))

    def _ask(self, asker: _Asker, number: int) -> None:
        refused = self._refusal(asker.by, number)
        if refused is not None:
            self._settle([ResetOutcome(asker, number, *refused)])
            return
        stop = self._clock.stop
        if stop.number == number and not stop.stopped and self._clock.feedback is not None:
            self._settle([ResetOutcome(asker, number, None)])
        elif self._attempts.ask(number, asker, time.monotonic()):
            self._wake.set()
            if not self._robot.send(Reset(by=asker.by.name[:500], number=number)):
                self._settle(self._attempts.robot_link_down(self._robot.detail))

    def _refusal(self, by: Actor, number: int) -> tuple[RefusalReason, str] | None:
        """Return the reason why `by` may not reset now; None: it may."""
        if by.role != "supervisor":
            if by.role not in PEOPLE:
                return "not_allowed", f"{'policies' if by.role == 'policy' else 'observers'} may not reset a stop"
            if not self._holds_seat(by):
                return "no_seat", "only the holder of the control seat or a supervisor may reset"
        now = time.monotonic()
        if not (self._of_link.spend(by.link or by.peer, now) and self._of_robot.spend("", now)):
            return "too_often", "too many resets with this link or for this robot"
        if not self._robot.up:
            return "link_down", self._robot.detail
        if self._stops.unconfirmed:
            return "stale_reset", "a stop is on its way to the robot"
        newest = max(self._clock.stop.number, self._stops.newest_number)
        if number < newest:  # also when no feedback has shown it yet
            return "stale_reset", f"the newest stop is number {newest}"
        return None

    def _holds_seat(self, by: Actor) -> bool:
        holder = self._peers.by_id(self._seat.holder) if self._seat.holder else None
        if holder is None:
            return False
        return by.peer == holder.id if by.peer else bool(by.link) and by.link == holder.identity.token_id

    def _settle(self, outcomes: list[ResetOutcome[_Asker]]) -> None:
        for outcome in outcomes:
            by, where = outcome.asker.by, outcome.asker.where
            if outcome.reason is None:
                self._events.publish(ResetDone(by, where, outcome.number))
                log.warning("reset", by=by.name, where=where, stop=outcome.number)
            else:
                self._events.publish(ResetRefused(by, where, outcome.reason))
            outcome.asker.tell(outcome)

    def _error(self, reason: str, detail: str) -> Exception:
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
                return Unconfirmed(detail) if self._robot.up else RobotLinkDown(detail)
