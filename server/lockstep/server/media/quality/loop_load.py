"""Measures how much of the event loop's time observers take."""

from collections.abc import Callable

__all__ = ["LoopLoad"]

SECONDS = 1.0  # between two measurements


class LoopLoad:
    """The load of one event loop."""

    def __init__(self, busy_seconds: Callable[[], float], now: float) -> None:
        """`busy_seconds`: as in `CooperativeScheduler`."""
        self._busy_seconds = busy_seconds
        self._before = now, busy_seconds()

    def measure(self, now: float) -> float | None:
        """Return the share of the time since the last measurement, 0 to 1; None if that is less than a second ago."""
        since, before = self._before
        if now - since < SECONDS:
            return None
        busy = self._busy_seconds()
        self._before = now, busy
        return (busy - before) / (now - since)
