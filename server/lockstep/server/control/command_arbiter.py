"""Decides which commands and rests pass to the robot. No I/O, no clock.

Every method returns an outcome, on which the caller acts. The arbiter never lets a second command pass while one is in
flight on the robot link: a repeat of it is absorbed, and a repeat of the event already executed is answered from the
feedback at hand. So the link's TCP never holds more than one command, and nothing is replayed after a stall.

The outcomes of a command; the first condition that holds decides:

| condition | outcome |
|---|---|
| the sender does not hold the seat | refused `no_seat` |
| the robot link is down, or no feedback has come yet | refused `link_down` |
| not one value per axis | refused `wrong_size` |
| a value is NaN or infinite, or the null of a rate axis | refused `not_a_number` |
| stopped, or a stop is on its way to the bridge | refused `stopped` |
| its event is the current one, and was the sender's own | answered with the current feedback |
| its event is the one in flight, and is the sender's own | absorbed |
| not the next event, or something is in flight | refused `out_of_order` |
| the console does not know the issue that it answers | refused `late` |
| its nonce is not that of this issue | refused `unseen` |
| it moves, and no neutral command of the sender was executed since that was last needed | refused `not_neutral` |
| else | rates clamped to the axes' ranges and the speed cap, `speed` of the goals lowered to the cap, forwarded |

Goals pass as they are: the bridge knows the newest measured values, which decide how far a goal may be, and an axis
that is outside its range may stay there.

A new holder of the seat has to send a neutral command first, and so has every holder after a stop, a reset, a new link
or epoch, and whenever the robot says so (`Feedback.neutral_needed`). The command counts once it was executed.

A repeat of another sender's event is not answered: after a hand-over the new holder would take the old one's
execution for its own.
"""

import math
from typing import NamedTuple

import msgspec

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, Refusal, RefusalReason, Rest, StopTaken
from lockstep.protocol.neutral import has_goals, neutral_value
from lockstep.protocol.serial import event_after, is_newer
from lockstep.server.control.known_issues import KnownIssues
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.speed_cap import SpeedCap, within_share
from lockstep.server.event_clock import EventClock
from lockstep.server.stop.stop_presses import StopPresses

__all__ = ["Absorbed", "Answer", "CommandArbiter", "CommandOutcome", "Forward", "ForwardRest", "Refuse", "RestOutcome"]


class Forward(NamedTuple):
    """Send the command to the robot, now."""

    command: Command


class ForwardRest(NamedTuple):
    """Send the rest to the robot, now."""

    rest: Rest


class Answer(NamedTuple):
    """Send the feedback to the peer that asked."""

    feedback: Feedback


class Refuse(NamedTuple):
    """Send the refusal to the peer that asked."""

    refusal: Refusal


class Absorbed(NamedTuple):
    """Do nothing: the same message is already on its way."""


CommandOutcome = Forward | Answer | Refuse | Absorbed
RestOutcome = ForwardRest | Refuse | Absorbed


class CommandArbiter:
    """Decides on commands and rests. Tell it of the link (`link_up`, `link_down`) and of every message of the bridge.

    Attributes:
        in_flight: the command that was forwarded and not answered yet; None: there is none
    """

    def __init__(
        self,
        clock: EventClock,
        seat: ControlSeat,
        presses: StopPresses | None = None,
        speed_cap: SpeedCap | None = None,
    ) -> None:
        """`presses`: presses of STOP; no command passes while one of them is unanswered."""
        self._clock = clock
        self._seat = seat
        self._presses = presses or StopPresses()
        self._speed_cap = speed_cap or SpeedCap("off")
        self._description: RobotDescription | None = None
        self._robot_link_is_up = False
        self.in_flight: Command | None = None
        self._sender = ""  # peer whose command was forwarded last
        self._sent_event = 0  # of that command; 0 before the first of this epoch
        self._abandoned = False  # its sender has given up the seat since
        self._resting: Rest | None = None  # forwarded and not yet followed by a feedback
        self._issues = KnownIssues()
        self._shown_stop = 0  # number of the newest stop that a feedback has shown
        self._newest_stop = 0  # number of the newest stop that the bridge has latched

    def robot_link_up(self, description: RobotDescription) -> None:
        self._description = description
        self._robot_link_is_up = True
        self._forget()

    def robot_link_down(self) -> None:
        self._robot_link_is_up = False
        self._forget()

    def epoch_ends(self) -> None:
        """Forget this epoch: nothing known of it holds in the next. Call before the clock begins another one."""
        self._sent_event = self._shown_stop = self._newest_stop = 0
        self._issues.clear()
        self._forget()

    def command(self, peer: str, command: Command, now: float = math.inf) -> CommandOutcome:
        """Decide on a command. Without `now` no measured delay counts, and a speed cap in force is at its lowest."""
        description, feedback = self._description, self._clock.feedback
        if not self._seat.holds(peer):
            return self._refuse(command, "no_seat")
        if not self._robot_link_is_up or description is None or feedback is None:
            return self._refuse(command, "link_down")
        if len(command.values) != len(description.axes):
            return self._refuse(command, "wrong_size", f"{len(description.axes)} values are needed")
        if not all(map(_is_number, command.values, description.axes)):
            return self._refuse(command, "not_a_number")
        # A stop is on its way to the bridge, or has arrived and no feedback has shown it.
        stop_is_coming = bool(self._presses.pending) or self._newest_stop > self._shown_stop
        if stop_is_coming or feedback.stop.stopped:
            return self._refuse(command, "stopped")
        is_repeat = self._sender == peer and self._sent_event == command.event
        if is_repeat and command.event == feedback.event:
            return Answer(feedback)
        if is_repeat and self.in_flight is not None:
            return Absorbed()
        if self.in_flight is not None or command.event != event_after(feedback.event):
            return self._refuse(command, "out_of_order")
        return self._next(peer, command, description, feedback.event, now)

    def _next(
        self, peer: str, command: Command, description: RobotDescription, event: int, now: float
    ) -> CommandOutcome:
        nonce = self._issues.nonce(command.issue)
        if nonce is None:
            return self._refuse(command, "late")
        if nonce != command.nonce:
            return self._refuse(command, "unseen", "the command has another nonce than the feedback that it answers")
        self._speed_cap.answered(peer, event, command, now)
        if self.moves(command) and not self._seat.may_move(peer):
            return self._refuse(command, "not_neutral", "send a neutral command first")
        self.in_flight = _clamped(command, description, self._speed_cap.share(now))
        self._sender, self._sent_event, self._abandoned = peer, command.event, False
        self._resting = None  # an earlier rest does not void this command
        return Forward(self.in_flight)

    def moves(self, command: Command) -> bool:
        """True if `command` is meant to move the robot; a light or horn that warns before motion does not count."""
        description = self._description
        if description is None:
            return False
        signal = "" if description.start_warning is None else description.start_warning.axis
        for value, axis in zip(command.values, description.axes, strict=False):
            if value != neutral_value(axis) and axis.name != signal:
                return True
        return False

    def rest(self, peer: str, rest: Rest) -> RestOutcome:
        """Forward a rest of the holder, always. If it names an event beyond the next one, it names the next instead."""
        if not self._seat.holds(peer):
            return self._refuse(rest, "no_seat")
        latest = event_after(self._clock.event)
        return self._forward_rest(Rest(event=latest) if is_newer(rest.event, latest) else rest)

    def abandon(self) -> RestOutcome:
        """Rest because the holder is gone or gave up the seat: its command in flight is void too."""
        self._abandoned = True
        return self._forward_rest(Rest(event=event_after(self._clock.event)))

    def stop_taken(self, taken: StopTaken) -> None:
        """Called when the bridge has latched a stop."""
        self._newest_stop = max(self._newest_stop, taken.number)

    def feedback(self, feedback: Feedback) -> None:
        """Take a feedback that the event clock accepted."""
        self._issues.add(feedback)
        answered = self.in_flight
        if answered is not None and not is_newer(answered.event, feedback.event):
            self.in_flight = None
        else:
            answered = None
        self._resting = None
        if feedback.stop.stopped or feedback.neutral_needed or feedback.stop.number > self._shown_stop:
            self._seat.neutral_needed()
        elif answered is not None and not self.moves(answered) and not self._abandoned:
            self._seat.neutral(self._sender)
        self._shown_stop = max(self._shown_stop, feedback.stop.number)

    def refused(self, refusal: Refusal) -> str:
        """Take a refusal of the bridge. Return the peer to tell, or "" for none."""
        if self.in_flight is not None and refusal.event in (0, self.in_flight.event):
            self.in_flight = None
            return self._sender
        return self._seat.holder

    def _forget(self) -> None:
        self.in_flight = None
        self._resting = None
        self._seat.neutral_needed()

    def _forward_rest(self, rest: Rest) -> RestOutcome:
        if not self._robot_link_is_up:
            return self._refuse(rest, "link_down")
        if rest == self._resting:
            return Absorbed()
        self._resting = rest
        return ForwardRest(rest)

    def _refuse(self, message: Command | Rest, reason: RefusalReason, detail: str = "") -> Refuse:
        refusal = Refusal(event=message.event, reason=reason, current=self._clock.event, detail=detail)
        return Refuse(refusal)


def _clamped(command: Command, description: RobotDescription, share: float) -> Command:
    values = [
        value if value is None or axis.kind == "goal" else within_share(axis, value, share)
        for value, axis in zip(command.values, description.axes, strict=True)
    ]
    speed = min(command.speed, share) if has_goals(description.axes) else command.speed
    return msgspec.structs.replace(command, values=values, speed=speed)


def _is_number(value: float | None, axis: Axis) -> bool:
    """Return whether the axis takes the value; only a goal axis takes null."""
    return axis.kind == "goal" if value is None else math.isfinite(value)
