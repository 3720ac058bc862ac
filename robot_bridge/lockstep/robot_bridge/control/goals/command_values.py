"""Judges the values of a command by the robot's axes. No I/O but the caller's measurement, no clock."""

import math
from collections.abc import Callable, Sequence

from lockstep.protocol.description import Axis, Pose
from lockstep.protocol.messages import RefusalReason
from lockstep.protocol.neutral import neutral_values
from lockstep.robot_bridge.control.goals.shared_joints import SharedJoints
from lockstep.robot_bridge.control.limits.goal_axis import shorter_way

__all__ = ["CommandValues"]


class CommandValues:
    """Tells whether the values of a command fit the axes, whether they move the robot, and how far."""

    def __init__(
        self,
        axes: Sequence[Axis],
        *,
        poses: Sequence[Pose] = (),
        signal: str = "",
        measured: Callable[[], Sequence[float]] | None = None,
    ) -> None:
        """`signal`: axis of a light or horn, which moves nothing; "": none.

        `measured`: returns the measured value of each axis now. None: no place is known.
        """
        self._axes = tuple(axes)
        self._neutral = neutral_values(axes)
        self._drives = [axis.name != signal for axis in axes]
        self._goals = [(number, axis.reach, axis.wrap) for number, axis in enumerate(axes) if axis.kind == "goal"]
        self._shared = SharedJoints(axes, poses)
        self._measured = measured

    def moves(self, values: Sequence[float | None]) -> bool:
        """Return whether these values, one per axis, are an intention to move."""
        return any(
            value != neutral and drives
            for value, neutral, drives in zip(values, self._neutral, self._drives, strict=True)
        )

    def misfit(self, values: Sequence[float | None], speed: float = 1.0) -> tuple[RefusalReason, str] | None:
        """Return why the values, or the speed of the goal axes, fit no state of this robot; None if they do."""
        if len(values) != len(self._neutral):
            return "wrong_size", f"{len(values)} values for {len(self._neutral)} axes"
        for value, neutral in zip(values, self._neutral, strict=True):
            if not (neutral is None if value is None else math.isfinite(value)):
                return "not_a_number", ""
        if not 0 <= speed <= 1:
            return "not_a_number", "speed"
        if (rivals := self._shared.conflict(values)) is not None:
            one, other = (self._axes[number].name for number in rivals)
            return "conflict", f"{one} and {other} move the same joints"
        return None

    def jump(self, values: Sequence[float | None]) -> str:
        """Return which goal is beyond the reach of its axis, or where the axis is not known; "": none."""
        places: Sequence[float] | None = None
        for number, reach, wrap in self._goals:
            goal = values[number]
            if goal is None:
                continue
            if places is None:
                places = [math.nan] * len(values) if self._measured is None else self._measured()
            way = goal - places[number] if wrap is None else shorter_way(places[number], goal, wrap)
            if not abs(way) <= reach:  # also where the place is not a number
                axis = self._axes[number]
                if math.isnan(places[number]):
                    return f"{axis.name}: its place is not known"
                return f"{axis.name}: {abs(way):.4g} {axis.unit} from where it is; its reach is {reach:g}"
        return ""
