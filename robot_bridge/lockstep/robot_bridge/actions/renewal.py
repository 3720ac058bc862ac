"""How long an action that moves the robot goes on without a renewal. No I/O, no clock: the caller hands in `now`."""

import math

__all__ = ["Renewal"]


class Renewal:
    """Decides whether the action that moves the robot goes on, waits at rest, or ends.

    An action that moves the robot in a way of its own ends when it was not renewed for `hold`. One that drives the axes
    waits then, because the axes are at rest. The next renewal lets it go on. After `max_event_age` it ends too. So an
    action also ends at its goal where a round trip takes longer than `hold`.

    Attributes:
        at: s, when the action began or was renewed last
        drives_axes: the action does, by its last step
    """

    def __init__(self, hold: float, max_event_age: float) -> None:
        self.at = -math.inf
        self.drives_axes = False
        self._hold = hold
        self._longest = max(hold, max_event_age)

    def begin(self, now: float) -> None:
        """An action begins to move the robot."""
        self.at, self.drives_axes = now, False

    def renew(self, now: float) -> bool:
        """Renew the action. False if it is too late."""
        if self.is_over(now):
            return False
        self.at = now
        return True

    def waits(self, now: float) -> bool:
        """Return whether the action waits to be renewed, and the axes rest."""
        return self.drives_axes and now - self.at >= self._hold

    def is_over(self, now: float) -> bool:
        """Return whether it is too late to renew the action."""
        return now - self.at >= (self._longest if self.drives_axes else self._hold)
