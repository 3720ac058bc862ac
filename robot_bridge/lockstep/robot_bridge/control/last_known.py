"""Keeps the last known value of each measurement, for feedback in which the robot could not measure. No I/O."""

import math
from collections.abc import Sequence

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.robot_bridge.robots.base import Measurement

__all__ = ["LastKnown"]


class LastKnown:
    """Makes measurements fit for sending: every number is finite, and unknown ones are named."""

    def __init__(self, description: RobotDescription) -> None:
        self._axis_names = [axis.name for axis in description.axes]
        self._joint_names = [joint.name for joint in description.joints]
        self._axes = [_before(axis) for axis in description.axes]
        self._joints = [0.0] * len(description.joints)

    def settle(self, measured: Measurement) -> tuple[Measurement, list[str]]:
        """Return the measurement, and the names of the axes and joints whose values in it are older ones."""
        unknown: list[str] = []
        self._axes = _settled(self._axis_names, measured.axes, self._axes, unknown)
        self._joints = _settled(self._joint_names, measured.joints, self._joints, unknown)
        return measured._replace(
            axes=list(self._axes),
            joints=list(self._joints),
            wrench=_whole(measured.wrench),
            ranges=_whole(measured.ranges),
        ), unknown


def _before(axis: Axis) -> float:
    """Return the value that stands for an axis that was never measured."""
    return axis.rest if axis.kind == "rate" else min(max(0.0, axis.minimum), axis.maximum)


def _settled(names: Sequence[str], values: Sequence[float], before: Sequence[float], unknown: list[str]) -> list[float]:
    if all(map(math.isfinite, values)):
        return list(values)
    unknown += [name for name, value in zip(names, values, strict=True) if not math.isfinite(value)]
    return [value if math.isfinite(value) else last for value, last in zip(values, before, strict=True)]


def _whole(values: list[float]) -> list[float]:
    """Return the values, or none if one is not finite: a sensor's values belong together."""
    return values if all(map(math.isfinite, values)) else []
