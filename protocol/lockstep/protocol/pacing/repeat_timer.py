"""The interval at which an unanswered command is repeated: RFC 6298 with a sub-second floor and cap.

Checked by tests/vectors/repeat.json. No I/O; all times in seconds.
"""

__all__ = ["FLOOR", "INITIAL", "RepeatTimer"]

ALPHA = 1 / 8
BETA = 1 / 4
K = 4
GRANULARITY = 0.010
FLOOR = 0.020  # below it a repeat would overtake an answer that is only a control tick late
CAP = 0.500
INITIAL = 0.100  # before the first sample


class RepeatTimer:
    """Estimates the round trip of a command, and from it the time to wait for its answer."""

    def __init__(self) -> None:
        self.interval = INITIAL
        self._smoothed: float | None = None
        self._variation = 0.0

    @property
    def round_trip(self) -> float | None:
        """Smoothed command-to-feedback time, None before the first sample."""
        return self._smoothed

    def sample(self, round_trip: float) -> None:
        """Take one measured round trip (RFC 6298 2.2, 2.3).

        Karn's rule is the caller's: take no sample of a command that was repeated, since its answer cannot be told from
        the answer to the repeat.
        """
        if self._smoothed is None:
            self._smoothed = round_trip
            self._variation = round_trip / 2
        else:
            self._variation += BETA * (abs(self._smoothed - round_trip) - self._variation)
            self._smoothed += ALPHA * (round_trip - self._smoothed)
        waited = self._smoothed + max(GRANULARITY, K * self._variation)
        self.interval = min(CAP, max(FLOOR, waited))

    @property
    def early(self) -> float:
        """The time to wait for the first answer where losses are expected: shorter, and wrong now and then."""
        if self._smoothed is None:
            return self.interval
        return min(CAP, max(FLOOR, self._smoothed + max(GRANULARITY, self._variation)))

    def wait(self, sends: int) -> float:
        """Return the time to wait after the `sends`-th sending of one event.

        The first two repeats come at the interval. Backing off at once, as TCP does (RFC 6298 5.5), would protect
        a queue that lock-step never builds: at most one small command is in flight.
        """
        return min(CAP, self.interval * 2.0 ** min(16, max(0, sends - 2)))
