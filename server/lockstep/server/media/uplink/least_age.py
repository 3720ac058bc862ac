"""Tells how long media waited on a path between two machines whose clocks differ by an unknown offset. No I/O."""

__all__ = ["LeastAge"]

BASE_SECONDS = 30.0  # the least age of this window and the one before is the path's own


class LeastAge:
    """The age of the medium that waited least: the path's own delay, and the clocks' offset."""

    def __init__(self) -> None:
        self._window_start: float | None = None
        self._current = self._previous = float("inf")  # s

    def wait(self, age: float, now: float) -> float:
        """Return for how many seconds a medium waited. `age`: its arrival less its capture, s, by two clocks."""
        if self._window_start is None:
            self._window_start = now
        elif now - self._window_start >= BASE_SECONDS:
            self._window_start, self._previous, self._current = now, self._current, float("inf")
        self._current = min(self._current, age)
        return age - min(self._current, self._previous)
