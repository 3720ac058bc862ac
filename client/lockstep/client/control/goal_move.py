"""Moves goal axes to values that may be out of reach, step by step. No I/O."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from lockstep.client.control.clutch import REACH_SHARE
from lockstep.client.errors import CommandError, GoalNotReached
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.protocol.neutral import neutral_values

__all__ = ["GoalMove"]

TOLERANCE = 0.05  # of an axis' reach, unless it is given
APPLIED = 0.1  # of the tolerance: nearer than this the applied goal has arrived
STALLED = 2.0  # s without progress after which a move has failed
PROGRESS = 0.1  # of the tolerance


@dataclass
class _Target:
    index: int  # in the description's axes
    axis: Axis
    goal: float
    tolerance: float
    nearest: float = math.inf  # distance of the measured value that counted as progress last

    def distance(self, value: float) -> float:
        """Return the signed way from `value` to the goal, the shorter way round."""
        difference = self.goal - value
        return difference if self.axis.wrap is None else math.remainder(difference, self.axis.wrap)

    def next_goal(self, measured: float, applied: float) -> float:
        """Return the goal to send: the target, or as far towards it as the reach allows."""
        way = self.distance(measured)
        ahead = self.distance(measured) - self.distance(applied)  # of the applied goal, from the measured value
        reach = REACH_SHARE * self.axis.reach
        goal = measured + min(max(way, min(-reach, ahead)), max(reach, ahead))
        return self.goal if goal == measured + way else goal


class GoalMove:
    """One move. With each feedback, ask `arrived`; else drive its `values`.

    Args:
        description: the robot's
        goals: by axis
        tolerance: in the axes' units, for all of them or by axis; None: a twentieth of each axis' reach

    Raises:
        CommandError: no goal axis of this name, or a goal that is not finite or out of the axis' range.
    """

    def __init__(
        self, description: RobotDescription, goals: Mapping[str, float], tolerance: Mapping[str, float] | float | None
    ) -> None:
        axes = {axis.name: (index, axis) for index, axis in enumerate(description.axes) if axis.kind == "goal"}
        unknown = ", ".join(goals.keys() - axes.keys())
        if unknown or not goals:
            raise CommandError(f"no goal axis {unknown}; there are {', '.join(axes) or 'none'}")
        self._neutral = neutral_values(description.axes)
        self._targets = [
            _Target(*axes[name], float(goal), _tolerance(axes[name][1], tolerance)) for name, goal in goals.items()
        ]
        self._progress_at: float | None = None
        for target in self._targets:
            _check_range(target.axis, target.goal)

    def arrived(self, feedback: Feedback, now: float) -> bool:
        """Return whether the measured values and the applied goals of this feedback are at the goals.

        Raises:
            GoalNotReached: the measured values have come no nearer for 2 s.
        """
        if self._there(feedback):
            return True
        self._judge_progress(feedback, now)
        return False

    def values(self, feedback: Feedback) -> list[float | None]:
        """Return the values to drive next, one per axis of the robot; the axes without a goal move nothing."""
        values = list(self._neutral)
        for target in self._targets:
            measured, applied = feedback.axes[target.index], self._applied(feedback, target)
            values[target.index] = target.next_goal(measured, measured if applied is None else applied)
        return values

    def _there(self, feedback: Feedback) -> bool:
        for target in self._targets:
            applied = self._applied(feedback, target)
            if applied is None or abs(target.distance(applied)) > APPLIED * target.tolerance:
                return False
            if abs(target.distance(feedback.axes[target.index])) > target.tolerance:
                return False
        return True

    def _judge_progress(self, feedback: Feedback, now: float) -> None:
        for target in self._targets:
            distance = abs(target.distance(feedback.axes[target.index]))
            if distance < target.nearest - PROGRESS * target.tolerance:
                target.nearest, self._progress_at = distance, now
        if self._progress_at is None:
            self._progress_at = now
        if now - self._progress_at > STALLED:
            worst = max(self._targets, key=lambda each: abs(each.distance(feedback.axes[each.index])) / each.tolerance)
            applied = self._applied(feedback, worst)
            raise GoalNotReached(worst.axis.name, worst.axis.unit, worst.goal, feedback.axes[worst.index], applied)

    def _applied(self, feedback: Feedback, target: _Target) -> float | None:
        return feedback.goals[target.index] if len(feedback.goals) == len(self._neutral) else None


def _tolerance(axis: Axis, tolerance: Mapping[str, float] | float | None) -> float:
    given = tolerance.get(axis.name) if isinstance(tolerance, Mapping) else tolerance
    found = TOLERANCE * axis.reach if given is None else given
    if not (math.isfinite(found) and found > 0):
        raise CommandError(f"the tolerance of {axis.name} is not above 0")
    return found


def _check_range(axis: Axis, goal: float) -> None:
    if not math.isfinite(goal):
        raise CommandError("a value is NaN or infinite")
    if axis.wrap is None and not axis.minimum <= goal <= axis.maximum:
        raise CommandError(f"{axis.name} goes from {axis.minimum:g} to {axis.maximum:g} {axis.unit}, not to {goal:g}")
