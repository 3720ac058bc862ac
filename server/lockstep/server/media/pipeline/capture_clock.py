"""Converts times of the bridge's monotonic clock to wall-clock capture times. No clock is read here."""

__all__ = ["CaptureClock"]

WINDOW_SECONDS = 30.0


class CaptureClock:
    """Estimates `wall clock - link clock` as the least difference seen at arrival.

    The smallest difference belongs to the message that waited least. The minimum covers the current window and the
    one before it, so that two clocks that drift apart are followed. Robot and console share no clock: the estimate
    is late by the shortest transport time, and only that.
    """

    def __init__(self) -> None:
        self._window_start: float | None = None  # link time, s
        self._current = float("inf")  # least offset in this window, s
        self._previous = float("inf")  # least offset in the last window, s

    def observe(self, link_time: float, wall_time: float) -> None:
        """Take the arrival at `wall_time` (s since 1970) of a medium captured at `link_time`."""
        if self._window_start is None:
            self._window_start = link_time
        elif link_time - self._window_start >= WINDOW_SECONDS:
            self._window_start = link_time
            self._previous, self._current = self._current, float("inf")
        self._current = min(self._current, wall_time - link_time)

    def wall_time(self, link_time: float) -> float:
        """Return the capture time in s since 1970. Call after at least one `observe`."""
        return link_time + min(self._current, self._previous)
