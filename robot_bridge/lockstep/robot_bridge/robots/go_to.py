"""An action that takes goal axes to a posture, by goals that pass through the bridge as an operator's do."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionRun, ActionStep

__all__ = ["GoTo"]

NEAR: Final = 0.03  # rad, of every joint
NEAR_SHARE: Final = 0.02  # of an axis' range, where that is nearer, and of every slide's
NEARER: Final = 1 / 3  # of NEAR, of all joints together, that counts as nearer
GOING: Final = "on its way"
PATIENCE: Final = 2.0  # s without getting nearer


class GoTo(ActionRun):
    """Moves some goal axes to their goals, all of them at once; the other goal axes stay, and rates rest.

    What a gripper holds may keep it from its goal: the action is done without it if the others are there.
    """

    waits = True

    def __init__(
        self,
        goals: Mapping[int, float],
        axes: Sequence[Axis],
        measured: Callable[[], Sequence[float]],
        tick: float,
        text: str,
        blocked: str = "something is in the way of the arm",
    ) -> None:
        """`goals`: rad or m, by number of axis. `axes`: all of the robot. `tick`: s between two steps.

        `measured`: the places of the axes, at least up to the last one that has a goal. `text`: what is said when it is
        there. `blocked`: what is said when it does not get there.
        """
        self._goals = {number: (goal, axes[number], _near(axes[number])) for number, goal in goals.items()}
        self._rest = [None if axis.kind == "goal" else axis.rest for axis in axes]
        self._measured = measured
        self._tick = tick
        self._text = text
        self._blocked = blocked
        self._whole = max(sum(self._left().values()), NEARER)
        self._least = self._whole + 1.0
        self._waited = 0.0  # s

    def step(self) -> ActionStep:
        left = self._left()
        total = sum(left.values())
        if math.isnan(total):
            raise ActionFailed("the place of a joint is not known")
        if max(left.values()) < 1.0:
            return ActionStep(progress=1.0, text=self._text, done=True)
        if total < self._least - NEARER:
            self._least, self._waited = total, 0.0
        else:
            self._waited += self._tick
        if self._waited > PATIENCE:
            others = [each for number, each in left.items() if not self._goals[number][1].grips]
            if others and max(others) < 1.0:
                return ActionStep(progress=1.0, text=self._text, done=True)
            raise ActionFailed(self._blocked)
        return ActionStep(progress=max(0.0, 1 - total / self._whole), text=GOING, values=self._values())

    def cancel(self) -> None:
        """The bridge brings the goals to rest."""

    def _left(self) -> dict[int, float]:
        """Return how far each axis is from its goal; 1.0: so far that it is just not there."""
        measured = self._measured()
        return {
            number: _distance(goal - measured[number], axis) / near
            for number, (goal, axis, near) in self._goals.items()
        }

    def _values(self) -> list[float | None]:
        return [self._goals[number][0] if number in self._goals else rest for number, rest in enumerate(self._rest)]


def _near(axis: Axis) -> float:
    share = NEAR_SHARE * (axis.maximum - axis.minimum) or NEAR
    return min(NEAR, share) if axis.unit == "rad" else share


def _distance(difference: float, axis: Axis) -> float:
    return abs(difference) if axis.wrap is None else abs(math.remainder(difference, axis.wrap))
