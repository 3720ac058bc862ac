"""Deadlines at a fixed period, without drift. No clock: the caller hands in `now`."""

__all__ = ["Ticker"]


class Ticker:
    """Beats at a fixed period. Call `wait` before each beat and sleep for the seconds that it returns.

    A beat may come early, at any time in the period that it ends: see `early`. There is one beat in each period then
    too, so early beats are no more beats.
    """

    def __init__(self, period: float, now: float, *, catch_up: int = 0) -> None:
        """`catch_up`: the number of missed beats made good at once; the rest are skipped and counted."""
        self._period = period
        self._catch_up = catch_up
        self._next = now
        self.skipped = 0

    def wait(self, now: float) -> float:
        """Move on by one beat, and return the seconds until it is due; 0 if it is due already."""
        self._next += self._period
        behind = int((now - self._next) / self._period) - self._catch_up
        if behind > 0:
            self.skipped += behind
            self._next += behind * self._period
        return max(0.0, self._next - now)

    def early(self, now: float) -> float:
        """Return the seconds until the beat that `wait` announced may come: its period has begun then; 0 if it has."""
        return max(0.0, self._next - self._period - now)

    def left(self, now: float) -> float:
        """Return the seconds until the beat after the one that `wait` announced last is due; negative: overdue."""
        return self._next + self._period - now

    def until_early(self, now: float) -> float:
        """Return the seconds until that beat may come; 0 if it may now."""
        return max(0.0, self._next - now)
