"""The gate for commands, which decides when the next one may leave. Checked by tests/vectors/pacing.json. No I/O."""

import math
from typing import Literal, NamedTuple

from lockstep.client.control.awaited_sound import AwaitedSound, hear, most_behind
from lockstep.protocol.serial import event_after, event_gap

__all__ = ["CALM_INTERVAL", "CommandGate", "GateState", "NextCommand", "Pacing"]

CALM_INTERVAL = 0.040  # s; events that follow one another sooner wait for pictures and sound
# An event that would take sound out of its tolerance waits for it so long at most, and for half of the time for which
# the robot holds a command. Armed and at rest, events follow one another no sooner.
SOUND_WAIT = 0.200  # s
# With feedback pacing sound that fell silent is waited for so long, by each event as above: what is late may still
# come. With media pacing one command waits all the while, so it waits no longer than above.
SILENCE = 0.600  # s
Pacing = Literal["feedback", "media"]
GateState = Literal["open", "no_feedback", "in_flight", "rate", "picture", "sound"]


class NextCommand(NamedTuple):
    """The numbers that a command sent now would carry."""

    event: int
    issue: int  # of the feedback that it answers


class CommandGate:
    """Opens when the last command was answered, the event rate allows another and, with pacing `media`, what is seen
    and heard will be within tolerance of the next feedback as well.

    The tolerance counts events, so each picture and each sound has less time where events follow one another quickly.
    Events sooner than `calm_interval` therefore wait while what is seen or heard is farther behind than two thirds of
    its tolerance; as long as no picture was shown, they wait for none. A picture that is too old stays until the next
    arrives; sound that is too old is gone. So an event that would make it too old waits for it, for `SOUND_WAIT`. A
    command that only lets go does not wait for it: the robot comes to rest as soon as without sound.
    """

    def __init__(
        self,
        pacing: Pacing,
        tolerance: int,
        min_interval: float,
        *,
        calm_interval: float | None = None,
        sound_tolerance: int = 0,
        hold: float = math.inf,
    ) -> None:
        """`calm_interval`: s; None: `min_interval`. `hold`: s for which the robot holds a command."""
        self.pacing = pacing
        self.tolerance = tolerance
        self.sound_tolerance = sound_tolerance
        self.min_interval = min_interval  # s between the first sendings of two events
        self.calm_interval = min_interval if calm_interval is None else max(calm_interval, min_interval)
        self._sound_wait = min(SOUND_WAIT, hold / 2)  # s
        self._feedback: tuple[int, int] | None = None  # newest (event, issue)
        self._in_flight: int | None = None
        self._sent_at: float | None = None
        self._shown: int | None = None
        self._sounds: dict[str, AwaitedSound] = {}  # by microphone

    @property
    def in_flight(self) -> int | None:
        """The event that was sent and not answered; None without one."""
        return self._in_flight

    def feedback(self, event: int, issue: int) -> bool:
        """Take a feedback; return True if it is newer than all before it."""
        if self._feedback is not None:
            ahead = event_gap(event, self._feedback[0])
            if ahead < 0 or (ahead == 0 and issue <= self._feedback[1]):
                return False
        self._feedback = (event, issue)
        if self._in_flight is not None and event_gap(event, self._in_flight) >= 0:
            self._in_flight = None
        return True

    def sent(self, now: float) -> None:
        """Note that the next command left for the first time."""
        self._in_flight = self.next().event
        self._sent_at = now

    def refused(self, event: int) -> bool:
        """Note that the robot or the console refused `event`; return True if that event was in flight."""
        if event != self._in_flight:
            return False
        self._in_flight = None
        return True

    def shown(self, stamp: int) -> None:
        """Note that a picture stamped `stamp` is on screen."""
        self._shown = stamp

    def heard(self, microphone: str, stamp: int, now: float) -> None:
        """Note that a segment of sound stamped `stamp` plays, or is too old to."""
        if self._feedback is not None:
            # With media pacing sound that stays at its tolerance would keep the gate shut.
            most_gap = most_behind(self.sound_tolerance) if self.pacing == "media" else self.sound_tolerance
            known = self._sounds.get(microphone)
            self._sounds[microphone] = hear(known, stamp, self._feedback[0], most_gap, now)

    def state(self, now: float, *, lets_go: bool = False) -> GateState:
        """Return "open", or the reason that the gate is closed. `lets_go`: the command would be neutral."""
        if self._feedback is None:
            return "no_feedback"
        if self._in_flight is not None:
            return "in_flight"
        if self._sent_at is not None and now < self.opens_at(now, lets_go=lets_go):
            return "rate"
        if self.pacing != "media":
            return "open"
        event, heard = self._feedback[0], self._farthest_heard(now)
        if self._shown is None or not _is_near(event_gap(event, self._shown), self.tolerance):
            return "picture"
        return "open" if lets_go or heard is None or _is_near(heard, self.sound_tolerance) else "sound"

    def opens_at(self, now: float, *, lets_go: bool = False) -> float:
        """Return the time at which the event rate allows the next command, unless a picture is shown or a segment is
        heard before."""
        if self._sent_at is None:
            return float("-inf")
        heard = self._farthest_heard(now)
        if self._picture_keeps_up() and (heard is None or _keeps_up(heard, self.sound_tolerance)):
            return self._sent_at + self.min_interval
        loses_sound = self.pacing != "media" and heard is not None and heard > most_behind(self.sound_tolerance)
        waits = loses_sound and not lets_go
        return self._sent_at + (max(self._sound_wait, self.calm_interval) if waits else self.calm_interval)

    def silent_at(self, now: float) -> float:
        """Return when a gate that waits for sound opens although none comes."""
        sounds, awaited = self._sounds.values(), self._awaited
        return min((each.silent_at(awaited) for each in sounds if each.is_awaited(awaited, now)), default=now)

    def next(self) -> NextCommand:
        """Return the command that an open gate lets pass.

        Raises:
            RuntimeError: there is no feedback yet.
        """
        if self._feedback is None:
            raise RuntimeError("no feedback to answer")
        return NextCommand(event_after(self._feedback[0]), self._feedback[1])

    def _picture_keeps_up(self) -> bool:
        if self._shown is None or self._feedback is None:
            return True
        return _keeps_up(event_gap(self._feedback[0], self._shown), self.tolerance)

    def _farthest_heard(self, now: float) -> int | None:
        """Return the gap of the microphone that is farthest behind of those that are heard; None if none is."""
        if self._feedback is None:
            return None
        event, sounds, awaited = self._feedback[0], self._sounds.values(), self._awaited
        return max((event_gap(event, each.stamp) for each in sounds if each.is_awaited(awaited, now)), default=None)

    @property
    def _awaited(self) -> float:
        """How long sound that fell silent is waited for, s."""
        return self._sound_wait if self.pacing == "media" else SILENCE


def _keeps_up(gap: int, tolerance: int) -> bool:
    return abs(gap) <= 2 * tolerance // 3


def _is_near(gap: int, tolerance: int) -> bool:
    """True if what is seen or heard stays within tolerance when the next feedback arrives, one event on. At tolerance 0
    nothing can; there the medium of the newest event suffices."""
    return -tolerance <= gap <= most_behind(tolerance)
