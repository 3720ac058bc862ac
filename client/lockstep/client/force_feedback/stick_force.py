"""Turns a measured force into the force on the operator's hand. No I/O."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.protocol.description import RobotDescription

__all__ = ["NO_FORCE", "StickForce", "contact_strength", "ramped", "stick_force"]


class StickForce(NamedTuple):
    """A force on the hand, seen from above: shares of the strongest, whose length is at most 1."""

    right: float
    ahead: float  # away from the operator

    @property
    def size(self) -> float:
        return math.hypot(self.right, self.ahead)

    @property
    def source_degrees(self) -> float:
        """The direction that it comes from, clockwise from ahead, 0 to 360, as Linux and USB PID have it."""
        return math.degrees(math.atan2(-self.right, -self.ahead)) % 360

    def scaled(self, factor: float) -> "StickForce":
        return StickForce(self.right * factor, self.ahead * factor)


NO_FORCE = StickForce(0.0, 0.0)


def contact_strength(force: float, description: RobotDescription) -> float:
    """Return how strongly a force (N) is felt: 0 up to the threshold, 1 from full on, between them by the curve."""
    if (feeling := description.force_feeling) is not None:
        threshold, full, curve = feeling.threshold_newtons, feeling.full_newtons, feeling.curve
    elif (sensor := description.wrench) is not None:
        threshold, full, curve = sensor.threshold_force, sensor.full_scale_force, 1.0
    else:
        return 0.0
    if not (force > threshold and full > threshold):
        return 0.0
    return float(min(1.0, (force - threshold) / (full - threshold)) ** curve)


def stick_force(wrench: Sequence[float], description: RobotDescription) -> StickForce:
    """Return what of a wrench (N, N m) the hand feels: x pushes ahead, y to the left (REP 103).

    Of a force from above or below, or of one that is not a number, the hand feels nothing.
    """
    if description.wrench is None or len(wrench) < 3:
        return NO_FORCE
    x, y, z = wrench[:3]
    force = math.sqrt(x * x + y * y + z * z)
    if not math.isfinite(force) or force == 0:
        return NO_FORCE
    share = contact_strength(force, description) / force
    return StickForce(-y * share, x * share)


def ramped(start: StickForce, goal: StickForce, growth: float, fall: float) -> StickForce:
    """Return the force on its way from `start` to `goal`: it grows by at most `growth`, and shrinks by `fall`."""
    way = StickForce(goal.right - start.right, goal.ahead - start.ahead)
    most = fall if goal.size < start.size else growth
    if way.size <= most:
        return goal
    step = way.scaled(most / way.size)
    return StickForce(start.right + step.right, start.ahead + step.ahead)
