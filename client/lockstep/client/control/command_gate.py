"""The gate for commands, which decides when the next one may leave. Checked by tests/vectors/pacing.json. No I/O."""

from typing import Literal, NamedTuple

from lockstep.protocol.serial import event_after, event_gap

__all__ = ["CALM_INTERVAL", "CommandGate", "GateState", "NextCommand", "Pacing"]

CALM_INTERVAL = 0.040  # s; events that follow one another sooner wait for the pictures

Pacing = Literal["feedback", "media"]
GateState = Literal["open", "no_feedback", "in_flight", "rate", "picture"]


class NextCommand(NamedTuple):
    """The numbers that a command sent now would carry."""

    event: int
    issue: int  # of the feedback that it answers


class CommandGate:
    """Opens when the last command was answered, the event rate allows another and, with pacing `media`, the picture on
    screen will be within tolerance of the next feedback as well.

    The tolerance counts events, so each picture has less time where events follow one another quickly. Events sooner
    than `calm_interval` therefore wait while the picture on screen is farther behind than two thirds of the tolerance;
    as long as no picture was shown, they wait for none.
    """

    def __init__(
        self, pacing: Pacing, tolerance: int, min_interval: float, *, calm_interval: float | None = None
    ) -> None:
        """`calm_interval`: s; None: `min_interval`."""
        self.pacing = pacing
        self.tolerance = tolerance
        self.min_interval = min_interval  # s between the first sendings of two events
        self.calm_interval = min_interval if calm_interval is None else max(calm_interval, min_interval)
        self._feedback: tuple[int, int] | None = None  # newest (event, issue)
        self._in_flight: int | None = None
        self._sent_at: float | None = None
        self._shown: int | None = None

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

    def state(self, now: float) -> GateState:
        """Return "open", or the reason that the gate is closed."""
        if self._feedback is None:
            return "no_feedback"
        if self._in_flight is not None:
            return "in_flight"
        if self._sent_at is not None and now < self.opens_at():
            return "rate"
        if self.pacing == "media" and not self._picture_is_near(self._feedback[0]):
            return "picture"
        return "open"

    def opens_at(self) -> float:
        """Return the time at which the event rate allows the next command, unless a picture is shown before."""
        if self._sent_at is None:
            return float("-inf")
        return self._sent_at + (self.min_interval if self._pictures_keep_up() else self.calm_interval)

    def next(self) -> NextCommand:
        """Return the command that an open gate lets pass.

        Raises:
            RuntimeError: there is no feedback yet.
        """
        if self._feedback is None:
            raise RuntimeError("no feedback to answer")
        return NextCommand(event_after(self._feedback[0]), self._feedback[1])

    def _pictures_keep_up(self) -> bool:
        if self._shown is None or self._feedback is None:
            return True
        return abs(event_gap(self._feedback[0], self._shown)) <= 2 * self.tolerance // 3

    def _picture_is_near(self, event: int) -> bool:
        """True if the picture on screen stays within tolerance when the next feedback arrives, one event on. At
        tolerance 0 no picture can; there the picture of the newest event suffices."""
        if self._shown is None:
            return False
        return -self.tolerance <= event_gap(event, self._shown) <= max(self.tolerance - 1, 0)
