"""Keeps the goals of joints that only their own axes drive. No I/O, no clock."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

__all__ = ["JointFollower"]

Array = npt.NDArray[np.float64]
SAME = 1e-9  # rad or m


class JointFollower:
    """Follows the applied goals of joints, no faster than `rates`, whatever is applied. The same calls as `PosedTool`.

    Attributes:
        joints: numbers of its axes in the robot's description
        goals: rad or m, now
    """

    def __init__(self, joints: Sequence[int], rates: Sequence[float], posture: Sequence[float]) -> None:
        self.joints = tuple(joints)
        self.goals = tuple(posture)
        self._rates = tuple(rates)
        self._before: tuple[float, ...] | None = None  # values of the tick before
        self._wanted: tuple[float, ...] | None = None  # while they are driven

    def drive(self, values: Sequence[float], seconds: float) -> Array:
        """Take the values of all axes of the robot; return the rates of these joints for the coming `seconds`."""
        own = tuple(values[number] for number in self.joints)
        before, self._before = self._before, own
        changed = before is not None and any(abs(a - b) > SAME for a, b in zip(own, before, strict=True))
        if changed and all(map(math.isfinite, own)):
            self._wanted = own
        if self._wanted is None:
            return np.zeros(len(own))
        old = self.goals
        self.goals = tuple(
            place + min(max(goal - place, -rate * seconds), rate * seconds)
            for place, goal, rate in zip(old, self._wanted, self._rates, strict=True)
        )
        return np.subtract(self.goals, old) / seconds

    def hold(self, posture: Sequence[float] | None = None) -> None:
        """Stay where the goals are, or in a posture, until the values change; as `ArmDrive.hold`."""
        self._wanted = None
        if posture is None:
            self._before = None
        else:
            self.goals = tuple(posture)

    def restart(self) -> None:
        """Stay where the goals are, whatever the next values are."""
        self.hold()
