"""The command desk: what may pass to the robot. No I/O, no clock.

Every verb returns what to do; the shell does it. The desk never lets a second command pass while one is in flight
on the robot link: a repeat of it is absorbed, and a repeat of the event already executed is answered from the
feedback at hand. So the link's TCP never holds more than one command, and nothing is replayed after a stall.

What happens to a command, in this order:

| condition | outcome |
|---|---|
| the sender does not hold the seat | refused `no_seat` |
| the robot link is down, or no feedback has come yet | refused `link_down` |
| not one value per axis | refused `wrong_size` |
| a value is NaN or infinite | refused `not_a_number` |
| stopped, or a stop is on its way to the bridge | refused `stopped` |
| its event is the current one, and was the sender's own | answered with the current feedback |
| its event is the one in flight, and is the sender's own | absorbed |
| not the next event, or something is in flight | refused `out_of_order` |
| it moves, and the sender has sent no neutral command since it got the seat | refused `not_neutral` |
| else | clamped to the axes' ranges and the speed cap, forwarded |

A repeat of somebody else's event is not answered: after a hand-over the new holder would take the old one's
execution for its own.
"""

import math
from typing import NamedTuple

import msgspec

from robot_bridge.protocol.description import RobotDescription
from robot_bridge.protocol.messages import Command, Feedback, Refusal, RefusalReason, Reset, Rest, Stop
from robot_bridge.protocol.serial import event_after, is_newer
from server.event_clock import EventClock
from server.seat import ControlSeat
from server.speed_cap import SpeedCap, within_share

__all__ = ["Absorbed", "Answer", "CommandDesk", "Forward", "Outcome", "Refuse"]

STOP_REPEAT = 0.05  # s within which a further stop, with no reset between, says nothing new


class Forward(NamedTuple):
    """Send to the robot, now."""

    message: Command | Rest | Stop | Reset


class Answer(NamedTuple):
    """Send to the peer that asked."""

    feedback: Feedback


class Refuse(NamedTuple):
    """Tell the peer that asked."""

    refusal: Refusal


class Absorbed(NamedTuple):
    """Nothing to do: the same is already on its way."""


Outcome = Forward | Answer | Refuse | Absorbed


class CommandDesk:
    """Call `link_up` before anything is forwarded, `link_down` when the link ends, and show it all the bridge says."""

    def __init__(self, clock: EventClock, seat: ControlSeat, speed_cap: SpeedCap | None = None) -> None:
        self._clock = clock
        self._seat = seat
        self._speed_cap = speed_cap or SpeedCap("off")
        self._description: RobotDescription | None = None
        self._link_is_up = False
        self._in_flight: Command | None = None
        self._sender = ""  # peer whose command was forwarded last
        self._sent_event = 0  # of that command; 0 before the first of this epoch
        self._resting: Rest | None = None  # forwarded and not yet followed by a feedback
        self._unconfirmed_stop: Stop | None = None  # asked for, no feedback has shown it yet; outlives the link
        self._last_stop_at = -math.inf

    @property
    def in_flight(self) -> Command | None:
        return self._in_flight

    @property
    def latched(self) -> Stop | None:
        """The stop that holds or is still to arrive; None when there is none."""
        held = self._clock.stop
        return self._unconfirmed_stop or (
            Stop(by=held.by, reason=held.reason, press=held.press) if held.stopped else None
        )

    def link_up(self, description: RobotDescription) -> Stop | None:
        """Returns a stop that nobody knows to have arrived: send it first of all."""
        self._description = description
        self._link_is_up = True
        self._forget()
        return self._unconfirmed_stop

    def epoch_ends(self) -> None:
        """Call before the clock begins another epoch: a bridge that starts anew must not release a latched stop."""
        self._sent_event = 0
        self._unconfirmed_stop = self.latched

    def link_down(self) -> None:
        self._link_is_up = False
        self._forget()

    def command(self, peer: str, command: Command, now: float = math.inf) -> Outcome:
        """Without `now` nothing that was measured counts any more, and a speed cap in force is at its lowest."""
        description, feedback = self._description, self._clock.feedback
        if not self._seat.holds(peer):
            return self._refuse(command, "no_seat")
        if not self._link_is_up or description is None or feedback is None:
            return self._refuse(command, "link_down")
        if len(command.values) != len(description.axes):
            return self._refuse(command, "wrong_size", f"{len(description.axes)} values are needed")
        if not all(map(math.isfinite, command.values)):
            return self._refuse(command, "not_a_number")
        if self._unconfirmed_stop is not None or feedback.stop.stopped:
            return self._refuse(command, "stopped")
        is_repeat = self._sender == peer and self._sent_event == command.event
        if is_repeat and command.event == feedback.event:
            return Answer(feedback)
        if is_repeat and self._in_flight is not None:
            return Absorbed()
        if self._in_flight is not None or command.event != event_after(feedback.event):
            return self._refuse(command, "out_of_order")
        self._speed_cap.answered(peer, feedback.event, command, now)
        if not self.moves(command):
            self._seat.neutral(peer)
        elif not self._seat.may_move(peer):
            return self._refuse(command, "not_neutral", "send a neutral command first")
        self._in_flight = self._clamped(command, description, self._speed_cap.share(now))
        self._sender, self._sent_event = peer, command.event
        return Forward(self._in_flight)

    def moves(self, command: Command) -> bool:
        """Whether `command` is an intention to move."""
        axes = () if self._description is None else self._description.axes
        return any(value != axis.rest for value, axis in zip(command.values, axes, strict=False))

    def rest(self, peer: str, rest: Rest) -> Outcome:
        """A rest of the holder always passes. One that names an event that is far ahead names the next instead."""
        if not self._seat.holds(peer):
            return self._refuse(rest, "no_seat")
        latest = event_after(self._clock.event)
        return self._forward_rest(Rest(event=latest) if is_newer(rest.event, latest) else rest)

    def abandon(self) -> Outcome:
        """The holder is gone or gave up the seat: what it has under way is void too."""
        return self._forward_rest(Rest(event=event_after(self._clock.event)))

    def stop(self, by: str, reason: str, now: float) -> Forward | Absorbed:
        """Anyone's, past every gate, also when the link is down: then `link_up` brings it up again."""
        stop, stopped = Stop(by=by, reason=reason), self._clock.stop.stopped
        if (stopped or self._unconfirmed_stop is not None) and now - self._last_stop_at < STOP_REPEAT:
            return Absorbed()
        if not stopped or not self._link_is_up:
            self._unconfirmed_stop = self._unconfirmed_stop or stop
        self._last_stop_at = now
        return Forward(stop)

    def reset(self, by: str, number: int) -> Outcome:
        """The caller has checked the role. `number`: of the newest stop that the sender has seen."""
        if not self._link_is_up:
            return self._refuse(None, "link_down")
        self._last_stop_at = -math.inf
        self._unconfirmed_stop = None  # the link keeps order: the bridge stops, then resets
        return Forward(Reset(by=by, number=number))

    def feedback(self, feedback: Feedback) -> None:
        """A feedback that the event clock accepted."""
        if self._in_flight is not None and not is_newer(self._in_flight.event, feedback.event):
            self._in_flight = None
        self._resting = None
        if feedback.stop.stopped:
            self._unconfirmed_stop = None

    def refused(self, refusal: Refusal) -> str:
        """The bridge refused something; returns the peer to tell, or "" for none."""
        if self._in_flight is not None and refusal.event in (0, self._in_flight.event) and not refusal.stop:
            self._in_flight = None
            return self._sender
        return self._seat.holder

    def _forget(self) -> None:
        self._in_flight = None
        self._resting = None
        self._last_stop_at = -math.inf

    def _forward_rest(self, rest: Rest) -> Outcome:
        if not self._link_is_up:
            return self._refuse(rest, "link_down")
        if rest == self._resting:
            return Absorbed()
        self._resting = rest
        return Forward(rest)

    def _clamped(self, command: Command, description: RobotDescription, share: float) -> Command:
        values = [
            within_share(axis, value, share) for value, axis in zip(command.values, description.axes, strict=True)
        ]
        return msgspec.structs.replace(command, values=values)

    def _refuse(self, message: Command | Rest | None, reason: RefusalReason, detail: str = "") -> Refuse:
        event = 0 if message is None else message.event
        return Refuse(Refusal(event=event, reason=reason, current=self._clock.event, detail=detail))
