"""How many of a camera's pictures each of many observers gets. No I/O.

| observers | pictures |
|---|---|
| up to the size of a crowd | all |
| more | every second |
| more than two and a half times as many | every third |

Fewer pictures come at once, more only when for five seconds a fifth fewer watch than the step takes: somebody who comes
and goes at the edge changes nothing.
"""

__all__ = ["Crowd"]

HUGE = 2.5  # times the size
EDGE = 0.8  # of a step's observers, below which it is left
AFTER = 5.0  # s


class Crowd:
    """One per media plane."""

    def __init__(self, size: int) -> None:
        self.size = size  # observers who still get everything
        self.divisor = 1  # of the camera's rate
        self._fewer_since: float | None = None

    def watch(self, observers: int, now: float) -> int:
        """So many watch now; returns the divisor."""
        wanted = self._step(observers)
        if wanted > self.divisor:
            self.divisor = wanted
        eased = self._step(observers / EDGE)
        if eased >= self.divisor:
            self._fewer_since = None
        elif self._fewer_since is None:
            self._fewer_since = now
        elif now - self._fewer_since >= AFTER:
            self.divisor, self._fewer_since = eased, None
        return self.divisor

    def _step(self, observers: float) -> int:
        return 1 + (observers > self.size) + (observers > HUGE * self.size)
