"""One position limit of the robot description. No I/O, no clock."""

import math
from collections.abc import Sequence

from robot_bridge.motion_demand import Demand, doubt, travel
from robot_bridge.protocol.description import PositionLimit, RobotDescription

__all__ = ["PositionGuard"]


class PositionGuard:
    """Says what the axes ask of the limit.

    What leads away from the bound is not set off against what leads there: the axes do not all stop at the same time.
    """

    def __init__(self, limit: PositionLimit, description: RobotDescription, tick_seconds: float) -> None:
        index = {axis.name: number for number, axis in enumerate(description.axes)}
        self.name = limit.name
        self.label = limit.label
        self.axes = tuple(index[each.axis] for each in limit.axes)
        self.by_posture = any(each.gain is None for each in limit.axes)
        self._joint = [joint.name for joint in description.joints].index(limit.joint)
        self._gains = tuple(0.0 if each.gain is None else each.gain for each in limit.axes)
        self._brakes = tuple(description.axes[number].brake for number in self.axes)
        self._brake_of = dict(zip(self.axes, self._brakes, strict=True))
        self._minimum = -math.inf if limit.minimum is None else limit.minimum + limit.margin
        self._maximum = math.inf if limit.maximum is None else limit.maximum - limit.margin
        self._reaction = tick_seconds + limit.latency

    def demands(self, offsets: Sequence[float], joints: Sequence[float], rates: Sequence[float] | None) -> list[Demand]:
        """Empty when nothing that it limits moves.

        `offsets`: of all axes from rest. `rates`: of the joints now, for limits by posture; None: not known.
        """
        moving = [number for number in self.axes if offsets[number]]
        if not moving:
            return []
        position = joints[self._joint] if self._joint < len(joints) else math.nan
        if not math.isfinite(position):
            return [doubt(self.name, tuple(moving))]
        if self.by_posture:
            return [self._posture_demand(moving, offsets, position, rates)]
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

    def _posture_demand(
        self, moving: list[int], offsets: Sequence[float], position: float, rates: Sequence[float] | None
    ) -> Demand:
        rate = math.nan if rates is None or self._joint >= len(rates) else rates[self._joint]
        if not math.isfinite(rate):
            return doubt(self.name, tuple(moving))
        braking = max([abs(offsets[number]) / self._brake_of[number] for number in moving])
        room = self._maximum - position if rate > 0 else position - self._minimum
        speed = abs(rate)
        return Demand(self.name, tuple(moving) if speed else (), speed * self._reaction, speed * braking / 2, room)
