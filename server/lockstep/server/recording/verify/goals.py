"""Checks the promises about goal axes (docs/robot-link.md, "Goal axes"). No I/O."""

import math

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord

__all__ = ["GoalChecks"]

ROOM = 0.1  # s of motion at full speed: a tick, and a measurement beside it
ROUNDING = 1e-6  # of a value and of its axis' range


class GoalChecks:
    """Show it commands and feedbacks in the order of the file; each call returns the fault that it found, or ""."""

    def __init__(self) -> None:
        self._axes: tuple[Axis, ...] = ()
        self._has_goals = False
        self._of_poses: set[str] = set()  # a pose's axes, and those that it replaces, begin where the others led
        self._newest: FeedbackRecord | None = None

    def describe(self, description: RobotDescription) -> None:
        """Take the description, at the start of the file and with each change of the link, and forget the past."""
        self._axes = description.axes
        self._has_goals = any(axis.kind == "goal" for axis in self._axes)
        self._of_poses = {
            name for pose in description.poses for name in (*pose.position, *pose.rotation, *pose.instead_of)
        }
        self._newest = None

    @property
    def looking(self) -> bool:
        """Whether the robot has goal axes."""
        return self._has_goals

    def command(self, command: CommandRecord) -> str:
        """Take a forwarded command."""
        if not self._has_goals:
            return ""
        for axis, value in zip(self._axes, command.values, strict=False):
            if value is None and axis.kind == "rate":
                return f"a command has no value for {axis.name}"
        return ""

    def feedback(self, feedback: FeedbackRecord, executed: CommandRecord | None) -> str:
        """Take a feedback. `executed`: the command that became its event; None if it is a later issue, or not known."""
        if not self._has_goals:
            return ""
        before, self._newest = self._newest, feedback
        if len(feedback.goals) != len(self._axes):
            return "a feedback has no applied goals"
        for axis, goal in zip(self._axes, feedback.goals, strict=True):
            if goal is not None and axis.kind == "rate":
                return f"a feedback has a goal of {axis.name}, which is driven by its rate"
        if before is None or len(before.goals) != len(self._axes):
            return ""
        return self._too_fast(before, feedback) or ("" if executed is None else self._jump(before, feedback, executed))

    def _too_fast(self, before: FeedbackRecord, feedback: FeedbackRecord) -> str:
        if before.stop.stopped or before.stop.number != feedback.stop.number:
            return ""  # after a reset they begin where the robot is measured
        seconds = max(feedback.time - before.time, 0.0) + ROOM
        for axis, was, goal in zip(self._axes, before.goals, feedback.goals, strict=True):
            if was is None or goal is None or axis.name in self._of_poses:
                continue
            way = _distance(axis, was, goal)
            if way > axis.slew * seconds + _rounding(axis):
                return f"the applied goal of {axis.name} moved by {way:g} {axis.unit} in {seconds - ROOM:.3f} s"
        return ""

    def _jump(self, before: FeedbackRecord, feedback: FeedbackRecord, executed: CommandRecord) -> str:
        """Compare with both measurements around the execution, since the bridge's own is between them."""
        for axis, value, was, measured in zip(self._axes, executed.values, before.axes, feedback.axes, strict=False):
            if value is None or axis.kind == "rate":
                continue
            goal = value if axis.wrap else min(max(value, axis.minimum), axis.maximum)
            away = min(_distance(axis, was, goal), _distance(axis, measured, goal))
            if away > axis.reach + axis.slew * ROOM + _rounding(axis):
                return f"a goal of {axis.name} was {away:g} {axis.unit} from the measured value, and executed"
        return ""


def _distance(axis: Axis, one: float, other: float) -> float:
    return abs(math.remainder(one - other, axis.wrap) if axis.wrap else one - other)


def _rounding(axis: Axis) -> float:
    return ROUNDING * (1.0 + axis.maximum - axis.minimum)
