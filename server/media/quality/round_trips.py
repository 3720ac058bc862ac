"""What round trips say about a queue in the network. No clock is read here."""

__all__ = ["RoundTrips"]

WINDOW = 30.0  # s; the shortest round trip of this window and the one before is that of the empty path
LEAST_QUEUE = 0.040  # s that count as a queue on any path
SHARE = 0.15  # of the empty path's round trip
SPREADS = 3.0  # of the usual difference between two round trips
MOST_FOR_SPREAD = 0.15  # s
SLOPE_MIN, SLOPE_MAX = 0.0, 3.0


class RoundTrips:
    """The queue's delay is what a round trip takes longer than the shortest one."""

    def __init__(self) -> None:
        self.queue = 0.0  # s; of the newest round trip
        self.growth = 0.0  # s of queue per second, between the last two
        self.standing = False  # the last two were both longer than the limit
        self.at = float("-inf")  # when the newest one was measured
        self._window_start: float | None = None
        self._current = float("inf")
        self._previous = float("inf")
        self._last: tuple[float, float] | None = None  # when, round trip
        self._spread = 0.0

    @property
    def base(self) -> float:
        """Round trip of the empty path in s; 0 before the first."""
        least = min(self._current, self._previous)
        return 0.0 if least == float("inf") else least

    @property
    def limit(self) -> float:
        """Delay in s that is not yet a queue: paths differ by themselves."""
        return max(LEAST_QUEUE, SHARE * self.base, min(MOST_FOR_SPREAD, SPREADS * self._spread))

    def add(self, seconds: float, now: float) -> None:
        """A round trip was measured."""
        if self._window_start is None or now - self._window_start >= WINDOW:
            self._previous, self._current = self._current, float("inf")
            self._window_start = now
        self._current = min(self._current, seconds)
        before = self.queue > self.limit
        self.queue = seconds - self.base
        self.growth = 0.0
        if self._last is not None and now > self._last[0]:
            at, last = self._last
            self.growth = min(SLOPE_MAX, max(SLOPE_MIN, (seconds - last) / max(0.1, now - at)))
            # A growing queue must not pass for a path that varies: growth counts little.
            self._spread += (min(abs(seconds - last), 2 * LEAST_QUEUE) - self._spread) / 16
        self._last = now, seconds
        self.at = now
        self.standing = before and self.queue > self.limit

    @property
    def queued(self) -> bool:
        """Whether there is a queue: two long round trips, or one that is far too long."""
        return self.standing or self.queue > 2 * self.limit + LEAST_QUEUE

    def accept(self) -> None:
        """The path itself became longer: the newest round trip is that of the empty path now."""
        if self._last is not None:
            self._previous = float("inf")
            self._current = self._last[1]
            self.queue, self.standing = 0.0, False
