"""Passes commands and rests on to the robot, answers their senders, and times the command in flight.

The rules are in `command_arbiter.py`; this module does their I/O.
"""

import time
from typing import Protocol

from lockstep.protocol.console import encode_console_message
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest
from lockstep.protocol.traces.trace import CommandSpans
from lockstep.server.audit.records import Actor
from lockstep.server.control.command_arbiter import Absorbed, Answer, CommandArbiter, Forward, ForwardRest, Refuse
from lockstep.server.control.refusals import Refusals
from lockstep.server.control.trace_service import command_spans
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer import Peer
from lockstep.server.session_events import (
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    RestForwarded,
    SessionEvents,
)

__all__ = ["CommandService"]


class CommandsLink(Protocol):
    """The part of the connection to the robot that the service uses."""

    def send(self, message: Command | Rest) -> bool: ...


class MovingSeat(Protocol):
    """The part of the control seat that the service uses."""

    def moved(self, peer: Peer) -> None: ...


class RenewedActions(Protocol):
    """The part of the actions that the service uses."""

    def renews(self, id: str) -> bool: ...


class CommandService:
    """All methods are called on the loop and return at once. Tell `arbiter`, the rules, of the link and of stops."""

    def __init__(
        self,
        arbiter: CommandArbiter,
        robot: CommandsLink,
        seat: MovingSeat,
        actions: RenewedActions,
        clock: EventClock,
        refusals: Refusals,
        events: SessionEvents,
    ) -> None:
        self.arbiter = arbiter
        self._robot = robot
        self._seat = seat
        self._actions = actions
        self._clock = clock
        self._refusals = refusals
        self._events = events
        self._forwarded_at = 0.0  # departure of the command in flight
        self._forward_seconds = 0.0  # from its arrival to its departure

    def command(self, peer: Peer, command: Command, now: float) -> None:
        outcome = self.arbiter.command(peer.id, command, now)
        if isinstance(outcome, Forward) and not self._forward(outcome, now):
            outcome = Refuse(Refusal(event=0, reason="link_down", current=self._clock.event))
        if isinstance(outcome, Answer) and not peer.answers.allows(now, queues=peer.media.queues):
            outcome = Absorbed()
        match outcome:
            case Forward(forwarded):
                if self.arbiter.moves(forwarded) or self._actions.renews(forwarded.action):
                    self._seat.moved(peer)
                self._events.publish(CommandForwarded(peer.actor, forwarded))
            case Refuse(refusal):
                self._refusals.send(peer, "control", refusal)
                if refusal.reason in ("out_of_order", "unseen", "late") and self._clock.feedback is not None:
                    peer.send_feedback(encode_console_message(self._clock.feedback))
                self._events.publish(CommandRefused(peer.actor, command, refusal.reason))
            case Answer(feedback):
                peer.send_feedback(encode_console_message(feedback))
                self._events.publish(CommandRepeated(peer.actor, command, answered=True))
            case Absorbed():
                self._events.publish(CommandRepeated(peer.actor, command, answered=False))

    def _forward(self, outcome: Forward, arrived: float) -> bool:
        self._forwarded_at = time.monotonic()
        is_sent = self._robot.send(outcome.command)
        self._forward_seconds = self._forwarded_at - arrived
        return is_sent

    def rest(self, peer: Peer, rest: Rest) -> None:
        outcome = self.arbiter.rest(peer.id, rest)
        if isinstance(outcome, ForwardRest):
            if self._robot.send(outcome.rest):
                self._events.publish(RestForwarded(peer.actor, outcome.rest, ""))
            else:
                self._refusals.refuse(peer, "control", "link_down")
        elif isinstance(outcome, Refuse):
            self._refusals.send(peer, "control", outcome.refusal)

    def abandon(self, why: str) -> None:
        """Rest the robot before anybody else drives: the last holder's command in flight is void too."""
        outcome = self.arbiter.abandon()
        if isinstance(outcome, ForwardRest) and self._robot.send(outcome.rest):
            self._events.publish(RestForwarded(Actor(), outcome.rest, why))

    def feedback(self, feedback: Feedback) -> Command | None:
        """Take a feedback that the event clock accepted. Return the command that became its event, if one did."""
        command = self.arbiter.in_flight
        self.arbiter.feedback(feedback)
        return command if self.arbiter.in_flight is None else None

    def turnaround(self, now: float) -> float:
        """Return the seconds since the newest command was forwarded."""
        return now - self._forwarded_at

    def spans(self, robot: CommandSpans, turnaround: float, back: float) -> CommandSpans:
        """Return the spans of the newest command. `robot`: as the bridge has measured them; `back`: s, at the console.

        `turnaround`: s, from its departure to the arrival of its feedback.
        """
        return command_spans(robot, forward=self._forward_seconds, link=turnaround, back=back)
