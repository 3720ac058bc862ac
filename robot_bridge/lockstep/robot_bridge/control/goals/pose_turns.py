"""Lets goal axes that move the same joints take turns. No I/O, no clock.

While one set is driven, the goals of the other are out of date: its axes have moved with the joints. When the other set
begins to be driven, its goals are read from the robot; until then they do not change, so that an adapter can tell by
the values which set is driven.

The goals of a pose with `settling` are out of date also when it has settled: the robot may have come to rest before it
got there. While a command drives it, the robot pursues goals that stand still, as long as there is time to settle
before `hold` has passed; the pose has not settled then.
"""

import math
from collections.abc import Callable, Collection, Sequence

from lockstep.protocol.description import Axis, Pose
from lockstep.robot_bridge.control.goals.shared_joints import SharedJoints
from lockstep.robot_bridge.control.limits.goal_axis import GoalAxis
from lockstep.robot_bridge.control.limits.rate_axis import RateAxis

__all__ = ["PoseTurns"]


class PoseTurns:
    """Knows the goals that are out of date. Call `take` before each tick in which axes are driven, `pursue` when the
    limits of the tick are known, and `settle` when the axes have taken it.

    Attributes:
        settled: a pose has settled since this was set to False
        pursued_poses: names of the poses with `settling` whose goals the robot pursues while they stand still
    """

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
        self._stale: set[int] = set()  # axes whose goals are out of date
        self._settling = {number for number, axis in self._axes.items() if axis.settling > 0.0}
        index = {axis.name: number for number, axis in enumerate(axes)}
        self._poses = [
            (pose.name, [self._axes[index[name]] for name in (*pose.position, *pose.rotation) if name])
            for pose in poses
            if pose.settling > 0.0
        ]
        self._driven: set[int] = set()  # axes of `_settling` that were driven since their goals were read
        self.settled = False
        self.pursued_poses: list[str] = []

    @property
    def unread(self) -> Collection[int]:
        """The axes whose goals are, or will be when they have settled, out of date until they are read anew."""
        return self._stale.union(*(self._shared.mates[number] for number in self._driven))

    def begin(self) -> None:
        """All goals are up to date."""
        self._stale.clear()
        self._driven.clear()

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
                axis.waits = not all(self._axes[rival].stands for rival in rivals)
                if not axis.waits:
                    beginning.append(number)
            else:
                self._note_driven(number)
        if beginning:
            self._begin(beginning)

    def pursue(self, left: float, slowed: Collection[GoalAxis | RateAxis] = ()) -> None:
        """Note which poses the robot pursues in this tick.

        `left`: s before all motion has to have ended; 0: released. `slowed`: the axes that a limit slows in this tick.
        """
        self.pursued_poses = []
        for name, axes in self._poses:
            pursued = any(axis.may_move and left > axis.settling for axis in axes) and not any(
                axis in slowed for axis in axes
            )
            if pursued:
                self.pursued_poses.append(name)
            for axis in axes:
                axis.is_pursued = pursued

    def settle(self, released: bool) -> None:
        """Note the poses that have settled. `released`: no axis is driven."""
        for number in list(self._driven):
            if self._axes[number].is_driven and not released:
                continue
            mates = self._shared.mates[number]
            if all((released or not self._axes[mate].is_driven) and self._axes[mate].stands for mate in mates):
                self._driven -= mates
                self._stale |= mates
                self.settled = True

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
            self._note_driven(number)

    def _note_driven(self, number: int) -> None:
        self._stale |= self._shared.rivals[number]
        if number in self._settling:
            self._driven.add(number)
