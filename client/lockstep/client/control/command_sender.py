"""Decides without I/O which command or rest to send and when, and tells the outcome of each intention.

Call `feedback`, `refusal`, `intend` and `rest`, and tell the gate what is shown and heard. After each call, and at
`wake_at`, send the messages that `due` returns, and hand out the results that `outcomes` returns.

- One command is in flight; its repeats carry the newest intention under the same event number, and answer the newest
  issue of its feedback.
- Armed and without a new intention for `IDLE`, the sender sends neutral values at that interval.
- When the robot may move no longer, the sender gives up the command in flight and the wanted values, and sends no
  neutral command until a caller asks for it with `arm`.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.client.control.command_gate import CommandGate, NextCommand
from lockstep.client.control.intention import Intention, Want
from lockstep.client.control.readiness import Readiness
from lockstep.client.control.resting import RestCall
from lockstep.client.control.retransmission import Retransmission
from lockstep.protocol.messages import Command, Feedback, Refusal, RefusalReason, Rest
from lockstep.protocol.serial import FIRST_EVENT, event_gap

__all__ = ["Outcome", "CommandSender"]

IDLE = 0.2  # s; 5 Hz
TURN = 0.1  # s that a caller has for its next intention after it waited longer than `IDLE` for an answer
PATIENT_REASONS = {"late", "out_of_order", "rested", "unseen", "warning"}  # another try, on fresh feedback, can succeed
NEVER = float("inf")


class Outcome(NamedTuple):
    """The outcome of all intentions up to `ticket`: `feedback` or `refusal` is set."""

    ticket: int
    feedback: Feedback | None
    refusal: Refusal | None


class _Flight:
    """The command that was sent and not answered."""

    def __init__(self, command: Command, want: Want, ticket: int, *, neutral: bool) -> None:
        self.event = command.event
        self.neutral = neutral  # True if it asks for nothing but rest
        self.want = want
        self.ticket = ticket  # of the intention that it was sent for
        self.issue = command.issue  # the issue that the last sending answered


class CommandSender:
    """The operator's side of the command loop.

    Attributes:
        gate: decides when the next command may leave
        intention: the values that the caller wants
        readiness: whether the robot may move
        retransmission: the repeats of the command in flight
        armed: True while neutral values leave although nothing is wanted
        holds_seat: False: the executed event is another peer's
        newest: the newest feedback; None before the first
        sent_at: events and their first sendings, for the picture delay
    """

    def __init__(self, gate: CommandGate, neutral: Sequence[float | None]) -> None:
        self.gate = gate
        self.intention = Intention(neutral)
        self.readiness = Readiness()
        self.retransmission = Retransmission()
        self.armed = False
        self.holds_seat = True
        self.newest: Feedback | None = None
        self.sent_at: deque[tuple[int, float]] = deque(maxlen=256)
        self._idle_at = NEVER
        self._flight: _Flight | None = None
        self._void: int | None = None  # an event that only neutral values may use
        self._used_up: NextCommand | None = None  # would answer a feedback that can no longer be answered
        self._moved = False  # values were sent since the robot was last proven to be at rest
        self._rest: RestCall | None = None
        self._outcomes: deque[Outcome] = deque()

    # Input

    def feedback(self, feedback: Feedback, now: float) -> bool:
        """Take a feedback; return True if it is newer than all before it."""
        if not self.gate.feedback(feedback.event, feedback.issue):
            return False
        self.newest = feedback
        if self._void is not None and event_gap(feedback.event, self._void) >= 0:
            self._void = None
        if self._flight is not None and event_gap(feedback.event, self._flight.event) >= 0:
            self._landed(self._flight, feedback, now)
        wanted = self._flight is not None or self.intention.want is not Want.NOTHING
        lost_by = self.readiness.lost_by(feedback, wanted=wanted)
        if lost_by is not None:
            self.hold_back(lost_by)
        if self._rest is not None and self._rest.proven_by(feedback, now):
            self._rest = None
            self._moved = False
        return True

    def seat_changed(self, holds_seat: bool) -> None:
        """Note that this console holds the control seat from now on, or does not hold it."""
        self.holds_seat = holds_seat
        self.hold_back("not_neutral" if holds_seat else "no_seat")

    def hold_back(self, reason: RefusalReason) -> None:
        """Give up the wanted values and the flight for `reason`; the robot may not move until the next `arm`."""
        self.readiness.unready()
        if self.readiness.arming and reason == "not_neutral" and self.intention.is_neutral:
            return  # arming cures this; values that were wanted since then are of before the loss
        self.armed = False
        self.readiness.lose()
        self.intention.want = Want.NOTHING
        if self._flight is not None:
            self.gate.refused(self._flight.event)
            self._flight = None
        current = FIRST_EVENT if self.newest is None else self.newest.event
        refusal = Refusal(event=current, reason=reason, current=current)
        self._outcomes.append(Outcome(self.intention.ticket, None, refusal))

    def refusal(self, refusal: Refusal) -> None:
        """Take a refusal. If fresh feedback can cure it, try again; otherwise it becomes an outcome."""
        flight = self._flight
        if flight is None or not self.gate.refused(refusal.event or flight.event):
            return  # event 0: the console could not even tell which
        self._flight = None
        if refusal.reason == "rested":
            self._void = flight.event
        elif refusal.reason in PATIENT_REASONS:
            self._used_up = NextCommand(self.gate.next().event, flight.issue)
        intention, readiness = self.intention, self.readiness
        if refusal.reason not in PATIENT_REASONS:
            intention.want = Want.NOTHING
            self.armed = False
            readiness.lose()
            self._outcomes.append(Outcome(intention.ticket, None, refusal))
        elif self.armed or readiness.arming:
            intention.want = max(intention.want, flight.want, key=lambda want: want.value)
        else:
            intention.want = Want.NEUTRAL if readiness.ready else Want.NOTHING
            self._outcomes.append(Outcome(flight.ticket, None, refusal))

    # Intentions

    def intend(self, values: Sequence[float | None], now: float, speed: float = 1.0) -> int:
        """Send these values next; a command in flight repeats with them. Arms, and ends a rest. Returns a ticket."""
        self.armed = True
        self._rest = None
        self._idle_at = now + IDLE
        return self.intention.set(values, speed)

    def arm(self) -> int:
        """Send a neutral command, after which the robot may move. Returns a ticket, whose outcome is its feedback."""
        self._rest = None
        self.readiness.begin()
        return self.intention.set(None)

    def rest(self, now: float) -> None:
        """Send a rest at once, until it is proven, and one neutral command; then nothing. Disarms."""
        self.armed = False
        self.readiness.give_up_arming()
        wanted = self.intention.want
        self.intention.forget(wanted)
        if self._rest is not None:
            return
        if wanted is Want.VALUES and self.newest is not None:
            gone = Refusal(event=self.gate.next().event, reason="rested", current=self.newest.event)
            self._outcomes.append(Outcome(self.intention.ticket, None, gone))
        self.intention.want = Want.NOTHING
        if self.newest is None:
            return
        event = self._flight.event if self._flight is not None else self.newest.event
        self._rest = RestCall(Rest(event=event), once=not self._moved, now=now)
        if self._moved and self.readiness.ready:
            self.intention.want = Want.NEUTRAL

    @property
    def resting(self) -> bool:
        """True while a rest that was asked for is not proven."""
        return self._rest is not None

    # Output

    def due(self, now: float) -> list[Command | Rest]:
        """Return the messages to send now."""
        messages: list[Command | Rest] = []
        if self._rest is not None and now >= self._rest.due_at:
            messages.append(self._rest.send(now, self.retransmission.timer))
            if self._rest.once:
                self._rest = None
        intention, flight = self.intention, self._flight
        if self.armed and intention.want is Want.NOTHING and flight is None and now >= self._idle_at:
            intention.forget(Want.NEUTRAL)
        if flight is not None:
            messages += self._again(flight, now)
        elif intention.want is not Want.NOTHING and self.gate.state(now, lets_go=intention.lets_go) == "open":
            following = self.gate.next()
            if following != self._used_up:
                messages.append(self._next(following, now))
        return messages

    def wake_at(self, now: float) -> float:
        """Return the time to call `due` again without input before; infinity if only input can change anything."""
        moments = [NEVER if self._rest is None else self._rest.due_at]
        if self._flight is not None:
            moments.append(self.retransmission.due_at)
        elif self.intention.want is not Want.NOTHING:
            lets_go = self.intention.lets_go
            match self.gate.state(now, lets_go=lets_go):
                case "rate":
                    moments.append(self.gate.opens_at(now, lets_go=lets_go))
                case "sound":
                    moments.append(self.gate.silent_at(now))
        elif self.armed:
            moments.append(self._idle_at)
        return min(moments)

    def outcomes(self) -> list[Outcome]:
        """Return the outcomes of intentions since the last call, oldest first."""
        taken = list(self._outcomes)
        self._outcomes.clear()
        return taken

    def _next(self, following: NextCommand, now: float) -> Command:
        event, issue = following
        intention = self.intention
        want = Want.NEUTRAL if event == self._void else intention.want
        command = intention.command(event, issue, _nonce(self.newest), want)
        ticket = intention.ticket if want is Want.VALUES else 0
        self._flight = _Flight(command, want, ticket, neutral=intention.moves_nothing(command))
        self.retransmission.sent(now)
        self.gate.sent(now)
        self.sent_at.append((event, now))
        self._idle_at = now + IDLE
        if want is intention.want:
            intention.want = Want.NOTHING
        if want is Want.VALUES:
            self._moved = True
        elif self._rest is not None:
            self._rest.neutral = event
        return command

    def _again(self, flight: _Flight, now: float) -> list[Command | Rest]:
        """Return the repeat or the echoes of the command in flight that are due."""
        copies = self.retransmission.copies(now)
        if not copies:
            return []
        flight.issue = self.gate.next().issue
        want = Want.NEUTRAL if flight.event == self._void else Want.VALUES
        return [self.intention.command(flight.event, flight.issue, _nonce(self.newest), want)] * copies

    # After an answer

    def _landed(self, flight: _Flight, feedback: Feedback, now: float) -> None:
        if not self.holds_seat:
            self.hold_back("no_seat")  # that event was the command of another peer
            return
        self._flight = None
        match self.readiness.answered(feedback, neutral=flight.neutral):
            case "again":
                self.intention.want = Want.VALUES
            case "failed":
                self.hold_back("not_neutral")
            case None:
                pass
        self.retransmission.answered(feedback.issue, now)
        if flight.ticket and self.readiness.ready:
            self._outcomes.append(Outcome(flight.ticket, feedback, None))
            self._idle_at = max(self._idle_at, now + TURN)


def _nonce(newest: Feedback | None) -> int:
    """Return the nonce of the issue that the gate answers."""
    return 0 if newest is None else newest.nonce
