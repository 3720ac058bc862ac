"""Checks that a feedback fits the robot's description. No I/O."""

from collections.abc import Sequence

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback

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
        if not all(-MOST <= value <= MOST for value in found):
            return f"a feedback whose {name} are not numbers"
    if not (0 <= feedback.time <= LONGEST and 0 <= feedback.warning <= LONGEST):
        return "a feedback without a time"
    return ""
