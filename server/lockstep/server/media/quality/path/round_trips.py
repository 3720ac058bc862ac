"""Estimates the queue in the network from round trips. No clock is read here."""

from collections import deque

__all__ = ["RoundTrips"]

WINDOW = 30.0  # s; the shortest round trip of this window and the one before is that of the empty path
LEAST_QUEUE = 0.060  # s that count as a queue on any path
SHARE = 0.15  # of the empty path's round trip
SPREADS = 3.0  # of the usual difference between two round trips
MOST_FOR_SPREAD = 0.15  # s
FEW, SURE = 2, 3  # consecutive round trips that prove a long queue, and a short one
KEEP = 4.0  # s
MOST_GROWTH = 3.0


class RoundTrips:
    """Measures the queue's delay: the excess of round trips over the shortest one.

    One long round trip may come from a busy computer: a queue lengthens all of them, so the shortest of the last few
    counts.
    """

    def __init__(self) -> None:
        self.at = float("-inf")  # time of the newest measurement
        self.growth = 0.0  # s of queue per second, lately
        self._recent: deque[tuple[float, float]] = deque(maxlen=SURE)  # time, round trip
        self._window_start: float | None = None
        self._current = float("inf")
        self._previous = float("inf")
        self._spread = 0.0

    @property
    def base(self) -> float:
        """Round trip of the empty path in s; 0 before the first."""
        least = min(self._current, self._previous)
        return 0.0 if least == float("inf") else least

    @property
    def limit(self) -> float:
        """The largest delay in s that is not yet a queue: round trips vary even on an empty path."""
        return max(LEAST_QUEUE, SHARE * self.base, min(MOST_FOR_SPREAD, SPREADS * self._spread))

    @property
    def queue(self) -> float:
        """The time in s that packets wait in the network; 0 before two round trips are known."""
        return self._least(FEW)

    @property
    def queued(self) -> bool:
        """True if the queue is too long."""
        return self._least(SURE) > self.limit or self._least(FEW) > 2 * self.limit

    def add(self, seconds: float, now: float) -> None:
        """Add a measured round trip."""
        if self._window_start is None or now - self._window_start >= WINDOW:
            self._previous, self._current = self._current, float("inf")
            self._window_start = now
        self._current = min(self._current, seconds)
        while self._recent and now - self._recent[0][0] > KEEP:
            self._recent.popleft()
        if self._recent:
            at, last = self._recent[-1]
            # A growing queue must not pass for a path that varies: one difference counts for little.
            self._spread += (min(abs(seconds - last), 2 * LEAST_QUEUE) - self._spread) / 16
            at, last = self._recent[0]
            self.growth = min(MOST_GROWTH, max(0.0, (seconds - last) / max(0.2, now - at)))
        self._recent.append((now, seconds))
        self.at = now

    def accept(self) -> None:
        """Take the latest round trips as those of the empty path: the path itself became longer."""
        if self._recent:
            self._previous = float("inf")
            self._current = min(seconds for _, seconds in self._recent)
            self._recent.clear()

    def _least(self, count: int) -> float:
        if len(self._recent) < count:
            return 0.0
        return min(seconds for _, seconds in list(self._recent)[-count:]) - self.base
