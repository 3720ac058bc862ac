"""How long an action that moves the robot goes on without a renewal. No I/O, no clock: the caller hands in `now`."""

import math

__all__ = ["LONGEST", "Renewal"]

LONGEST = 2.0  # s without a renewal, after which no action goes on unless `hold` is longer


class Renewal:
    """Decides whether the action that moves the robot goes on, waits at rest, or ends.

    An action that was not renewed for `hold` ends. One that waits (`ActionRun.waits`) has only driven axes, which are
    at rest then. The next renewal lets it go on. After `LONGEST` it ends too. So an action also ends at its goal where
    a round trip takes longer than `hold`.

    Attributes:
        at: s, when the action began or was renewed last
    """

    def __init__(self, hold: float) -> None:
        self.at = -math.inf
        self._hold = hold
        self._longest = hold

    def begin(self, now: float) -> None:
        """An action begins to move the robot."""
        self.at, self._longest = now, self._hold

    def let_wait(self) -> None:
        """The action that has begun is one that waits."""
        self._longest = max(self._hold, LONGEST)

    def renew(self, now: float) -> bool:
        """Renew the action. False if it is too late."""
        if self.is_over(now):
            return False
        self.at = now
        return True

    def waits(self, now: float) -> bool:
        """Return whether the action waits to be renewed, and the axes rest."""
        return self._hold <= now - self.at < self._longest

    def is_over(self, now: float) -> bool:
        """Return whether it is too late to renew the action."""
        return now - self.at >= self._longest
