"""The clock by which links end. It never runs backwards, not even across restarts. No I/O."""

import threading

__all__ = ["LinkClock"]


class LinkClock:
    """Seconds since 1970: the wall clock's, or the newest time ever seen plus the time since then, if that is later.

    A link that was seen to have expired stays expired, whatever the wall clock says later. If the wall clock was ahead,
    time goes on from there.

    Args:
        seen: the newest time of an earlier run, s since 1970; 0 for none
        steady: time of a monotonic clock in s, here and in all methods
    """

    def __init__(self, seen: float, steady: float) -> None:
        self._seen = seen
        self._steady = steady
        self._busy = threading.Lock()

    def at(self, wall: float, steady: float) -> float:
        """Return the time at the wall clock's `wall`. Thread-safe."""
        with self._busy:
            self._seen = max(wall, self._seen + max(0.0, steady - self._steady))
            self._steady = max(self._steady, steady)
            return self._seen

    def saw(self, seen: float) -> None:
        """Take note of a time that another process saw."""
        with self._busy:
            self._seen = max(self._seen, seen)
