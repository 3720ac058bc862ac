"""Checks that a feedback fits the robot's description. No I/O."""

from collections.abc import Sequence

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.feedback_size import MAX_FEEDBACK_BYTES, is_too_large
from lockstep.protocol.messages import Feedback
from lockstep.protocol.neutral import has_goals

__all__ = ["misfit"]

WRENCH = 6  # values
MOST = 1e12  # bound of any measured value, in its unit: further from zero nothing can be added, rounded or drawn
LONGEST = 1e9  # s, of a monotonic clock


def misfit(feedback: Feedback, description: RobotDescription) -> str:
    """Return the first misfit, such as a wrong number of values or an impossible value; "" if all fits."""
    rays = 0 if description.ranges is None else description.ranges.count
    values: tuple[tuple[str, Sequence[float], tuple[int, ...]], ...] = (
        ("axes", feedback.axes, (len(description.axes),)),
        ("joints", feedback.joints, (len(description.joints),)),
        ("wrench", feedback.wrench, (0, WRENCH)),
        ("ranges", feedback.ranges, (0, rays)),
    )
    for name, found, lengths in values:
        if len(found) not in lengths:
            return f"a feedback with {len(found)} {name}"
        if not _are_numbers(found):
            return f"a feedback whose {name} are not numbers"
    if wrong := _misfit_of_goals(feedback.goals, description):
        return wrong
    if not (0 <= feedback.time <= LONGEST and 0 <= feedback.warning <= LONGEST):
        return "a feedback without a time"
    if is_too_large(feedback):
        return f"a feedback of more than {MAX_FEEDBACK_BYTES} bytes"
    return ""


def _are_numbers(values: Sequence[float]) -> bool:
    """Return whether no value is beyond `MOST` or not a number. The sum of hardly any feedback is beyond it."""
    return sum(map(abs, values)) <= MOST or all(-MOST <= value <= MOST for value in values)


def _misfit_of_goals(goals: Sequence[float | None], description: RobotDescription) -> str:
    if len(goals) != (len(description.axes) if has_goals(description.axes) else 0):
        return f"a feedback with {len(goals)} goals"
    for goal, axis in zip(goals, description.axes, strict=False):
        if goal is not None and (axis.kind == "rate" or not -MOST <= goal <= MOST):
            return f"a feedback with a goal of axis {axis.name} that cannot be"
    return ""
