"""Decides without I/O which command or rest to send and when, and tells the outcome of each intention.

Call `feedback`, `refusal`, `shown`, `heard`, `intend` and `rest`. After each call, and at `wake_at`, send the messages
that `due` returns, and hand out the results that `outcomes` returns.

- One command is in flight; its repeats carry the newest intention under the same event number, and answer the newest
  issue of its feedback.
- Armed and without a new intention for `IDLE`, the sender sends neutral values at that interval.
- A neutral command has to be executed before the robot may move: after taking the seat, a stop, a reset, a lost link,
  and whenever the robot says so. The neutral command lets motion begin again, so it is sent only when a caller asks
  for it with `arm`. The sender gives up the command in flight and the wanted values, and sends no neutral command
  until then.
- While the path loses packets every command is followed by `ECHOES` copies, `ECHO` apart, until its answer: a copy
  covers the loss of the command and, being answered from the stored feedback, the loss of the answer too. On a clean
  path nothing is copied.
- Losses come in a row. When a command and all copies were lost on such a path, the first repeat comes early, and each
  repeat is a salvo of `SALVO` copies, which ends with the answer: single repeats would wait out a row of lost packets
  one by one. A repeat that leaves before an answer can have arrived, on a path longer than the interval, is single.
"""

from collections import deque
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from lockstep.client.control.command_gate import CommandGate, GateState
from lockstep.client.control.repeat_timer import INITIAL, RepeatTimer
from lockstep.client.control.resting import RestCall
from lockstep.protocol.messages import Command, Feedback, Refusal, RefusalReason, Rest
from lockstep.protocol.serial import FIRST_EVENT, event_gap

__all__ = ["Outcome", "CommandSender"]

IDLE = 0.2  # s; 5 Hz
TURN = 0.1  # s that a caller has for its next intention after it waited longer than `IDLE` for an answer
ECHO = 0.020  # s; longer than the console's own path to the robot and back
ECHOES = 3  # at most; with the command itself as many packets as are lost in a row
SALVO = 12
SALVO_SPACING = 0.003  # s
SALVO_LEAST = 0.050  # s; with a shorter interval single repeats are as quick
LOSSY_SPELL = 60.0  # s to go on copying after the last loss that was seen
PATIENT_REASONS = {"late", "out_of_order", "rested", "unseen", "warning"}  # another try, on fresh feedback, can succeed
NEEDLESS = 0.75  # an answer within this part of a ping's round trip after the last repeat answers an earlier sending
NEEDLESS_BLIND = 0.25  # of the whole wait, while no ping is known
PINGS = 8  # pings, the shortest of which counts
FEW_SAMPLES = 8
NEVER = float("inf")


class Outcome(NamedTuple):
    """The outcome of all intentions up to `ticket`: `feedback` or `refusal` is set."""

    ticket: int
    feedback: Feedback | None
    refusal: Refusal | None


class _Want(Enum):
    """The values that the next command is to carry."""

    NOTHING = 0
    NEUTRAL = 1
    VALUES = 2


class _Flight:
    """The command that was sent and not answered."""

    def __init__(self, command: Command, want: _Want, ticket: int, now: float, *, neutral: bool) -> None:
        self.command = command
        self.neutral = neutral  # True if it asks for nothing but rest
        self.want = want
        self.ticket = ticket  # of the intention that it was sent for
        self.issue = command.issue  # the issue that the last sending answered
        self.sends = 1
        self.first_sent_at = now
        self.last_sent_at = now
        self.repeat_at = NEVER
        self.echo_at = NEVER
        self.echoes_left = 0
        self.spacing = ECHO  # s between two echoes


class CommandSender:
    """The operator's side of the command loop."""

    def __init__(self, gate: CommandGate, neutral: Sequence[float | None]) -> None:
        self.gate = gate
        self.timer = RepeatTimer()
        self.action = ""  # id of the moving action that every command lets go on; "": none
        self.armed = False
        self.ready = False  # True if the robot may move: a neutral command was executed since one was last needed
        self.holds_seat = True  # False: the executed event is another peer's
        self.newest: Feedback | None = None
        self.repeats = 0  # sent because no answer came in time
        self.echoes = 0  # sent because the path loses packets
        self.sent_at: deque[tuple[int, float]] = deque(maxlen=256)  # event, first sending; for the picture delay
        self.samples: deque[float] = deque(maxlen=4096)  # s from first sending to feedback
        self._neutral = list(neutral)
        self._values = list(neutral)
        self._speed = 1.0  # share of the goal axes' largest speed that goes with the values
        self._want = _Want.NOTHING
        self._ticket = 0
        self._idle_at = NEVER
        self._flight: _Flight | None = None
        self._lossy_until = float("-inf")
        self._pings: deque[float] = deque(maxlen=PINGS)  # round trips; no command has a shorter one
        self._void: int | None = None  # an event that only neutral values may use
        self._arming = False  # a neutral command is wanted, or on its way
        self._asked_again = False  # the answer to it asked for another one
        self._stop_number: int | None = None  # of the newest stop seen; None before the first feedback
        self._used_up: tuple[int, int] | None = None  # a feedback that can no longer be answered
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
        if self._flight is not None and event_gap(feedback.event, self._flight.command.event) >= 0:
            self._landed(self._flight, feedback, now)
        self._look_for_stops(feedback)
        if self._rest is not None and self._rest.proven_by(feedback, now):
            self._rest = None
            self._moved = False
        return True

    def seated(self) -> None:
        """Note that this console holds the control seat from now on."""
        self.holds_seat = True
        self.hold_back("not_neutral")

    def unseated(self) -> None:
        """Note that this console does not hold the control seat, or no longer holds it."""
        self.holds_seat = False
        self.hold_back("no_seat")

    def hold_back(self, reason: RefusalReason) -> None:
        """Give up the wanted values and the flight for `reason`; the robot may not move until the next `arm`."""
        self.ready = False
        if self._arming and reason == "not_neutral" and self._values == self._neutral:
            return  # arming cures this; values that were wanted since then are of before the loss
        self.armed = self._arming = False
        self._want = _Want.NOTHING
        if self._flight is not None:
            self.gate.refused(self._flight.command.event)
            self._flight = None
        current = FIRST_EVENT if self.newest is None else self.newest.event
        self._outcomes.append(Outcome(self._ticket, None, Refusal(event=current, reason=reason, current=current)))

    def _look_for_stops(self, feedback: Feedback) -> None:
        known, self._stop_number = self._stop_number, feedback.stop.number
        if feedback.stop.stopped or known not in (None, feedback.stop.number):  # or stopped and reset since then
            if self.ready or self._arming or self._flight is not None or self._want is not _Want.NOTHING:
                self.hold_back("stopped")
        elif self.ready and feedback.neutral_needed:
            self.hold_back("not_neutral")

    def refusal(self, refusal: Refusal) -> None:
        """Take a refusal. If fresh feedback can cure it, try again; otherwise it becomes an outcome."""
        flight = self._flight
        if flight is None or not self.gate.refused(refusal.event or flight.command.event):
            return  # event 0: the console could not even tell which
        self._flight = None
        if refusal.reason == "rested":
            self._void = flight.command.event
        elif refusal.reason in PATIENT_REASONS and self.newest is not None:
            self._used_up = (self.newest.event, flight.issue)
        if refusal.reason not in PATIENT_REASONS:
            self._want = _Want.NOTHING
            self.armed = self._arming = self.ready = False
            self._outcomes.append(Outcome(self._ticket, None, refusal))
        elif self.armed or self._arming:
            self._want = max(self._want, flight.want, key=lambda want: want.value)
        else:
            self._want = _Want.NEUTRAL if self.ready else _Want.NOTHING
            self._outcomes.append(Outcome(flight.ticket, None, refusal))

    def shown(self, stamp: int) -> None:
        """Note that a picture of the main camera is on screen."""
        self.gate.shown(stamp)

    def heard(self, microphone: str, stamp: int, now: float) -> None:
        """Note that a segment of sound plays, or is too old to."""
        self.gate.heard(microphone, stamp, now)

    def ping_answered(self, round_trip: float) -> None:
        """Take a ping's round trip, in s; it stands in for that of a command while few of those are known."""
        self._pings.append(round_trip)
        if len(self.samples) < FEW_SAMPLES:
            self.timer.sample(round_trip)

    def loss(self, now: float) -> None:
        """Note that some message of this connection was lost."""
        self._lossy_until = now + LOSSY_SPELL

    # Intentions

    def intend(self, values: Sequence[float | None], now: float, speed: float = 1.0) -> int:
        """Send these values next; a command in flight repeats with them. Arms, and ends a rest. Returns a ticket."""
        self.armed = True
        self._rest = None
        self._values, self._speed = list(values), speed
        self._want = _Want.VALUES
        self._idle_at = now + IDLE
        self._ticket += 1
        return self._ticket

    def arm(self) -> int:
        """Send a neutral command, after which the robot may move. Returns a ticket, whose outcome is its feedback."""
        self._rest = None
        self._arming, self._asked_again = True, False
        self._values, self._speed = list(self._neutral), 1.0
        self._want = _Want.VALUES
        self._ticket += 1
        return self._ticket

    def rest(self, now: float) -> None:
        """Send a rest at once, until it is proven, and one neutral command; then nothing. Disarms."""
        self.armed = self._arming = False
        self._values, self._speed = list(self._neutral), 1.0
        if self._rest is not None:
            return
        if self._want is _Want.VALUES and self.newest is not None:
            gone = Refusal(event=self.gate.next().event, reason="rested", current=self.newest.event)
            self._outcomes.append(Outcome(self._ticket, None, gone))
        self._want = _Want.NOTHING
        if self.newest is None:
            return
        event = self._flight.command.event if self._flight is not None else self.newest.event
        self._rest = RestCall(Rest(event=event), once=not self._moved, now=now)
        self._want = _Want.NEUTRAL if self._moved and self.ready else _Want.NOTHING

    @property
    def resting(self) -> bool:
        """True while a rest that was asked for is not proven."""
        return self._rest is not None

    # Output

    def due(self, now: float) -> list[Command | Rest]:
        """Return the messages to send now."""
        messages: list[Command | Rest] = []
        if self._rest is not None and now >= self._rest.due_at:
            messages.append(self._rest.send(now, self.timer))
            if self._rest.once:
                self._rest = None
        if self.armed and self._want is _Want.NOTHING and self._flight is None and now >= self._idle_at:
            self._values, self._speed = list(self._neutral), 1.0
            self._want = _Want.NEUTRAL
        if self._flight is not None:
            messages += self._again(self._flight, now)
        elif self._want is not _Want.NOTHING and self._gate_state(now) == "open" and not self._is_used_up():
            messages.append(self._next(now))
        return messages

    def wake_at(self, now: float) -> float:
        """Return the time to call `due` again without input before; infinity if only input can change anything."""
        moments = [NEVER if self._rest is None else self._rest.due_at]
        if self._flight is not None:
            moments += [self._flight.repeat_at, self._flight.echo_at]
        elif self._want is not _Want.NOTHING:
            match self._gate_state(now):
                case "rate":
                    moments.append(self.gate.opens_at(now, lets_go=self._lets_go()))
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

    def _next(self, now: float) -> Command:
        event, issue = self.gate.next()
        want = _Want.NEUTRAL if self._only_neutral(event) else self._want
        command = self._command(event, issue, want)
        neutral = self.moves_nothing(command)
        flight = _Flight(command, want, self._ticket if want is _Want.VALUES else 0, now, neutral=neutral)
        flight.repeat_at = now + self._wait(1)
        if now < self._lossy_until:
            flight.echo_at, flight.echoes_left = now + ECHO, ECHOES
            if self.timer.early >= SALVO_LEAST:
                flight.repeat_at = now + max(self._least(), self.timer.early)
        self._flight = flight
        self.gate.sent(now)
        self.sent_at.append((event, now))
        self._idle_at = now + IDLE
        if want is self._want:
            self._want = _Want.NOTHING
        if want is _Want.VALUES:
            self._moved = True
        elif self._rest is not None:
            self._rest.neutral = event
        return command

    def _again(self, flight: _Flight, now: float) -> list[Command | Rest]:
        """Return the repeat or the echoes of the command in flight that are due."""
        copies = 0
        if now >= flight.repeat_at:
            copies = 1
            self.repeats += 1
            flight.sends += 1
            flight.last_sent_at = now
            wait = self._wait(flight.sends)
            flight.repeat_at = now + wait
            flight.echo_at, flight.echoes_left = NEVER, 0
            if now < self._lossy_until and wait >= SALVO_LEAST and self._could_be_answered(flight, now):
                flight.echo_at, flight.echoes_left, flight.spacing = now + SALVO_SPACING, SALVO - 1, SALVO_SPACING
        while now >= flight.echo_at:
            copies += 1
            self.echoes += 1
            flight.echoes_left -= 1
            flight.echo_at = flight.echo_at + flight.spacing if flight.echoes_left else NEVER
        if not copies:
            return []
        flight.issue = self.gate.next().issue
        want = _Want.NEUTRAL if self._only_neutral(flight.command.event) else _Want.VALUES
        return [self._command(flight.command.event, flight.issue, want)] * copies

    def _command(self, event: int, issue: int, want: _Want) -> Command:
        is_neutral = want is not _Want.VALUES
        return Command(
            event=event,
            issue=issue,
            values=list(self._neutral if is_neutral else self._values),
            nonce=self._nonce,
            action=self.action,
            speed=1.0 if is_neutral else self._speed,
        )

    def _gate_state(self, now: float) -> GateState:
        return self.gate.state(now, lets_go=self._lets_go())

    def _lets_go(self) -> bool:
        return not self.action and (self._want is _Want.NEUTRAL or self._values == self._neutral)

    def moves_nothing(self, command: Command) -> bool:
        """Return whether the command is neutral: each rate axis at rest, and no goal."""
        return list(command.values) == self._neutral

    def _could_be_answered(self, flight: _Flight, now: float) -> bool:
        """True if an answer can have arrived. Before that a repeat says nothing about losses, and a salvo would fill
        the window that SCTP has after a loss."""
        return not self._pings or now - flight.first_sent_at >= min(self._pings)

    @property
    def _nonce(self) -> int:
        """The nonce of the issue that the gate answers."""
        return 0 if self.newest is None else self.newest.nonce

    def _wait(self, sends: int) -> float:
        return max(self._least(), self.timer.wait(sends))

    def _least(self) -> float:
        """Return the least wait. A ping does not reach the robot: until the robot's share is known, pings may lengthen
        the wait but not shorten it."""
        return INITIAL if len(self.samples) < FEW_SAMPLES else 0.0

    def _only_neutral(self, event: int) -> bool:
        return event == self._void

    # After an answer

    def _landed(self, flight: _Flight, feedback: Feedback, now: float) -> None:
        if not self.holds_seat:
            self.hold_back("no_seat")  # that event was the command of another peer
            return
        self._flight = None
        self._prove(flight, feedback)
        taken = now - flight.first_sent_at
        self.samples.append(taken)
        soonest = NEEDLESS * min(self._pings) if self._pings else NEEDLESS_BLIND * taken
        # A later issue of this feedback is a refresh, not an answer.
        if feedback.issue == 1 and (flight.sends == 1 or now - flight.last_sent_at < soonest):
            self.timer.sample(taken)  # echoes make a sample too long at times, which is the safe side
        else:
            self.loss(now)  # and no sample, by Karn's rule
        if flight.ticket and self.ready:
            self._outcomes.append(Outcome(flight.ticket, feedback, None))
            self._idle_at = max(self._idle_at, now + TURN)

    def _prove(self, flight: _Flight, feedback: Feedback) -> None:
        """Decide whether the robot may move now. A neutral command that answers an issue from before, say, a reset has
        no effect at the robot, so one more follows it. A cause that outlives that one arose after the arming."""
        if feedback.stop.stopped or (not self.ready and not self._arming):
            return
        if not feedback.neutral_needed:
            if flight.neutral:
                self.ready, self._arming = True, False
        elif self._arming and self._asked_again:
            self._arming = False
            self.hold_back("not_neutral")
        elif self._arming:
            self._want = _Want.VALUES
            self._asked_again = flight.neutral

    def _is_used_up(self) -> bool:
        newest = self.newest
        return newest is not None and self._used_up == (newest.event, newest.issue)
