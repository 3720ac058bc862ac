"""Passes commands and rests on to the robot, answers their senders, and times the command in flight.

The rules are in `command_arbiter.py`; this module does their I/O.
"""

import time
from typing import Protocol

from lockstep.protocol.console import encode_console_message
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest, StopTaken
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


class CommandsRobotLink(Protocol):
    """The part of the connection to the robot that the service uses."""

    def send(self, message: Command | Rest) -> bool: ...


class MovingSeat(Protocol):
    """The part of the control seat that the service uses."""

    def moved(self, peer: Peer) -> None: ...


class RenewedActions(Protocol):
    """The part of the actions that the service uses."""

    def renews(self, id: str) -> bool: ...


class CommandService:
    """All methods are called on the loop and return at once."""

    def __init__(
        self,
        arbiter: CommandArbiter,
        robot: CommandsRobotLink,
        seat: MovingSeat,
        actions: RenewedActions,
        clock: EventClock,
        refusals: Refusals,
        events: SessionEvents,
    ) -> None:
        self._arbiter = arbiter
        self._robot = robot
        self._seat = seat
        self._actions = actions
        self._clock = clock
        self._refusals = refusals
        self._events = events
        self._forwarded_at = 0.0  # departure of the command in flight
        self._forward_seconds = 0.0  # from its arrival to its departure

    def command(self, peer: Peer, command: Command, now: float) -> None:
        outcome = self._arbiter.command(peer.id, command, now)
        if isinstance(outcome, Forward) and not self._forward(outcome, now):
            outcome = Refuse(Refusal(event=0, reason="link_down", current=self._clock.event))
        if isinstance(outcome, Answer) and not peer.answers.allows(now, queues=peer.media.queues):
            outcome = Absorbed()
        match outcome:
            case Forward(forwarded):
                if self._arbiter.moves(forwarded) or self._actions.renews(forwarded.action):
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
        outcome = self._arbiter.rest(peer.id, rest)
        if isinstance(outcome, ForwardRest):
            if self._robot.send(outcome.rest):
                self._events.publish(RestForwarded(peer.actor, outcome.rest, ""))
            else:
                self._refusals.refuse(peer, "control", "link_down")
        elif isinstance(outcome, Refuse):
            self._refusals.send(peer, "control", outcome.refusal)

    def abandon(self, why: str) -> None:
        """Rest the robot before anybody else drives: the last holder's command in flight is void too."""
        outcome = self._arbiter.abandon()
        if isinstance(outcome, ForwardRest) and self._robot.send(outcome.rest):
            self._events.publish(RestForwarded(Actor(), outcome.rest, why))

    def feedback(self, feedback: Feedback) -> Command | None:
        """Take a feedback that the event clock accepted. Return the command that became its event, if one did."""
        command = self._arbiter.in_flight
        self._arbiter.feedback(feedback)
        return command if self._arbiter.in_flight is None else None

    def timing(self, robot: CommandSpans, now: float, back: float) -> tuple[float, CommandSpans]:
        """Return the seconds from the newest command's departure to the arrival of its feedback, and its spans.

        Args:
            robot: the spans that the bridge has measured
            now: s, when the feedback arrived
            back: s, from there until the feedback was sent to the operator
        """
        turnaround = now - self._forwarded_at
        return turnaround, command_spans(robot, forward=self._forward_seconds, link=turnaround, back=back)

    def refused(self, refusal: Refusal) -> str:
        """Take a refusal of the bridge. Return the peer to tell, or "" for none."""
        return self._arbiter.refused(refusal)

    def stop_taken(self, taken: StopTaken) -> None:
        """Called when the bridge has latched a stop."""
        self._arbiter.stop_taken(taken)

    def robot_link_up(self, description: RobotDescription) -> None:
        self._arbiter.robot_link_up(description)

    def robot_link_down(self) -> None:
        self._arbiter.robot_link_down()

    def epoch_ends(self) -> None:
        """Forget this epoch. Call before the clock begins another one."""
        self._arbiter.epoch_ends()
