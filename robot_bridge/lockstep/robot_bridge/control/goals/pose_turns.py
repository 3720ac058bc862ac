"""Lets goal axes that move the same joints take turns. No I/O, no clock.

While one set is driven, the goals of the other are out of date: its axes have moved with the joints. When the other set
begins to be driven, its goals are read from the robot; until then they do not change, so that an adapter can tell by
the values which set is driven.
"""

import math
from collections.abc import Callable, Sequence

from lockstep.protocol.description import Axis, Pose
from lockstep.robot_bridge.control.goals.shared_joints import SharedJoints
from lockstep.robot_bridge.control.limits.goal_axis import GoalAxis
from lockstep.robot_bridge.control.limits.rate_axis import RateAxis

__all__ = ["PoseTurns"]


class PoseTurns:
    """Knows the goals that are out of date. Call `take` before each tick in which axes are driven."""

    def __init__(
        self,
        axes: Sequence[Axis],
        poses: Sequence[Pose],
        shaped: Sequence[RateAxis | GoalAxis],
        pursued: Callable[[], Sequence[float]],
    ) -> None:
        self._shared = SharedJoints(axes, poses)
        self._axes = {number: axis for number, axis in enumerate(shaped) if isinstance(axis, GoalAxis)}
        self._pursued = pursued
        self._stale: set[int] = set()  # axes whose goals the other set's motion has made out of date

    def begin(self) -> None:
        """All goals are up to date."""
        self._stale.clear()

    def take(self) -> None:
        """Let the axes that are driven begin, or wait until those that exclude them stand still and the robot knows
        where they have brought it.
        """
        beginning: list[int] = []
        for number, rivals in self._shared.rivals.items():
            axis = self._axes[number]
            axis.waits = False
            if not axis.is_driven:
                continue
            if number in self._stale:
                axis.waits = any(self._axes[rival].rate for rival in rivals)
                if not axis.waits:
                    beginning.append(number)
            else:
                self._stale |= rivals
        if beginning:
            self._begin(beginning)

    def as_brought(self, goals: list[float | None]) -> list[float | None]:
        """Return the goals with those that are out of date replaced by where the other set has brought the robot."""
        if not self._stale:
            return goals
        pursued = self._pursued()
        for number in self._stale:
            goals[number] = pursued[number] if math.isfinite(pursued[number]) else None
        return goals

    def _begin(self, beginning: list[int]) -> None:
        pursued = self._pursued()
        for number in beginning:
            mates = self._shared.mates[number] & self._stale
            if not all(math.isfinite(pursued[mate]) for mate in mates):
                self._axes[number].waits = True
                continue
            for mate in mates:
                self._axes[mate].begin(pursued[mate])
            self._stale -= mates
            self._stale |= self._shared.rivals[number]
