"""Guards position limits of joints whose motion depends on the posture: the robot tells the rates. No I/O, no clock.

Limits of the same axes are checked together, since all of them are checked in every tick that moves.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.protocol.description import PositionLimit, RobotDescription
from lockstep.robot_bridge.control.limits.stopping_distance import Demand, doubt

__all__ = ["JointLimitGuard", "is_by_posture"]


class _Bounds(NamedTuple):
    """The usable range of one limit's joint."""

    name: str
    joint: int
    minimum: float
    maximum: float
    reaction: float  # s until braking takes effect


class JointLimitGuard:
    """Computes the demands on the limits of one set of axes.

    Attributes:
        axes: their numbers
    """

    def __init__(
        self, axes: tuple[int, ...], limits: Sequence[PositionLimit], description: RobotDescription, tick_seconds: float
    ) -> None:
        joints = {joint.name: number for number, joint in enumerate(description.joints)}
        self.axes = axes
        self._brakes = tuple((number, description.axes[number].brake) for number in axes)
        self._bounds = tuple(
            _Bounds(
                limit.name,
                joints[limit.joint],
                -math.inf if limit.minimum is None else limit.minimum + limit.margin,
                math.inf if limit.maximum is None else limit.maximum - limit.margin,
                tick_seconds + limit.latency,
            )
            for limit in limits
        )

    def demands(self, offsets: Sequence[float], joints: Sequence[float], rates: Sequence[float] | None) -> list[Demand]:
        """Return the demands that exceed the room, and doubts; empty if nothing moves.

        `offsets`: of all axes from rest. `rates`: of the joints now; None: not known.
        """
        braking = 0.0  # s, until the last of the axes is at rest
        for number, brake in self._brakes:
            braking = max(braking, abs(offsets[number]) / brake)
        if not braking:
            return []
        known = min(len(joints), 0 if rates is None else len(rates))
        found: list[Demand] = []
        for name, joint, minimum, maximum, reaction in self._bounds:
            rate = rates[joint] if rates is not None and joint < known else math.nan
            position = joints[joint] if joint < known else math.nan
            if not (math.isfinite(position) and math.isfinite(rate)):
                found.append(doubt(name, self._moving(offsets)))
                continue
            speed = abs(rate)
            room = maximum - position if rate > 0 else position - minimum
            if speed and speed * (reaction + braking / 2) > room:
                found.append(Demand(name, self._moving(offsets), speed * reaction, speed * braking / 2, room))
        return found

    def _moving(self, offsets: Sequence[float]) -> tuple[int, ...]:
        return tuple(number for number in self.axes if offsets[number])


def is_by_posture(limit: PositionLimit) -> bool:
    """Return whether only the robot can tell how fast its axes move the joint."""
    return any(each.gain is None for each in limit.axes)
