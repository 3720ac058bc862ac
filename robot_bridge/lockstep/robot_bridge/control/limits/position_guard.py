"""Guards one position limit of the robot description whose joint its axes move by fixed gains. No I/O, no clock."""

import math
from collections.abc import Sequence

from lockstep.protocol.description import PositionLimit, RobotDescription
from lockstep.robot_bridge.control.limits.stopping_distance import Demand, doubt, travel

__all__ = ["PositionGuard"]


class PositionGuard:
    """Computes the axes' demands on the limit.

    Motion away from the bound is not set off against motion towards it: the axes do not all stop at the same time.
    """

    def __init__(self, limit: PositionLimit, description: RobotDescription, tick_seconds: float) -> None:
        index = {axis.name: number for number, axis in enumerate(description.axes)}
        self.name = limit.name
        self.axes = tuple(index[each.axis] for each in limit.axes)
        self._joint = [joint.name for joint in description.joints].index(limit.joint)
        self._gains = tuple(0.0 if each.gain is None else each.gain for each in limit.axes)
        self._brakes = tuple(description.axes[number].brake for number in self.axes)
        self._minimum = -math.inf if limit.minimum is None else limit.minimum + limit.margin
        self._maximum = math.inf if limit.maximum is None else limit.maximum - limit.margin
        self._reaction = tick_seconds + limit.latency

    def demands(self, offsets: Sequence[float], joints: Sequence[float]) -> list[Demand]:
        """Return the demands; empty if no axis of the limit moves. `offsets`: of all axes from rest."""
        moving = [number for number in self.axes if offsets[number]]
        if not moving:
            return []
        position = joints[self._joint] if self._joint < len(joints) else math.nan
        if not math.isfinite(position):
            return [doubt(self.name, tuple(moving))]
        return [
            self._demand(offsets, 1.0, self._maximum - position),
            self._demand(offsets, -1.0, position - self._minimum),
        ]

    def _demand(self, offsets: Sequence[float], direction: float, room: float) -> Demand:
        linear = square = 0.0
        towards: list[int] = []
        for number, gain, brake in zip(self.axes, self._gains, self._brakes, strict=True):
            if offsets[number] * gain * direction > 0:
                reacting, braking = travel(offsets[number], self._reaction, brake)
                linear, square = linear + abs(gain) * reacting, square + abs(gain) * braking
                towards.append(number)
        return Demand(self.name, tuple(towards), linear, square, room)
