"""Keeps the gripper's goal. No I/O, no clock."""

import math

__all__ = ["GripDrive"]


class GripDrive:
    """The goal never moves faster than `rate`, whatever is applied. The first value after `restart` moves nothing.

    Attributes:
        goal: rad, that the servo pursues now
    """

    def __init__(self, rate: float, place: float) -> None:
        """`rate`: rad/s. `place`: rad, where the gripper is."""
        self.goal = place
        self._rate = rate
        self._wanted = place  # rad, where the goal goes to
        self._before: float | None = None  # value of the tick before

    def drive(self, value: float, seconds: float) -> float:
        """Take the applied goal, rad, for the coming `seconds`; return the rate of the pursued one, rad/s."""
        before, self._before = self._before, value
        if before is not None and value != before and math.isfinite(value):
            self._wanted = value
        most = self._rate * seconds
        step = min(max(self._wanted - self.goal, -most), most)
        self.goal += step
        return step / seconds

    def hold(self, place: float | None = None) -> None:
        """Stay where the goal is, or at a place, rad, until the values change."""
        if place is not None:
            self.goal = place
        self._wanted = self.goal

    def restart(self) -> None:
        """Let the next value move nothing."""
        self._before = None
