"""The time by which links end: it never runs backwards, over restarts neither. No I/O."""

import threading

__all__ = ["LinkClock"]


class LinkClock:
    """Seconds since 1970: the wall clock's, or the newest time that was ever seen and what has passed since.

    A link that was seen to have expired stays expired, whatever the wall clock says later. After a wall clock that was
    ahead, time goes on from there.

    Args:
        seen: the newest time of an earlier run, s since 1970; 0 for none
        steady: of a clock that nobody sets, in s, as all that are called so here
    """

    def __init__(self, seen: float, steady: float) -> None:
        self._seen = seen
        self._steady = steady
        self._busy = threading.Lock()

    def at(self, wall: float, steady: float) -> float:
        """What time it is when the wall clock says `wall`. May be called from any thread."""
        with self._busy:
            self._seen = max(wall, self._seen + max(0.0, steady - self._steady))
            self._steady = max(self._steady, steady)
            return self._seen

    def saw(self, seen: float) -> None:
        """Another process saw this time."""
        with self._busy:
            self._seen = max(self._seen, seen)
