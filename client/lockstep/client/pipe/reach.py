"""Bounds a command's goals to what the robot takes. No I/O."""

from collections.abc import Mapping, Sequence

from lockstep.client.control.clutch import REACH_SHARE
from lockstep.protocol.description import Axis

__all__ = ["within_reach"]


def within_reach(
    axes: Sequence[Axis], measured: Sequence[float], applied: Sequence[float | None], wanted: Mapping[str, float]
) -> dict[str, float]:
    """Return the values with each goal no further from the measured value than the robot accepts, and in its range.

    A goal beyond an axis' `reach` would be refused as a jump, and with it the whole command. The applied goal is never
    bounded: an arm that hangs below it would move. Values of rate axes and of axes with `wrap` are bounded by their
    range alone.

    Args:
        measured: of the newest feedback, one per axis; empty without a feedback
        applied: its goals
        wanted: values by axis
    """
    place = {axis.name: number for number, axis in enumerate(axes)}
    bounded = {}
    for name, value in wanted.items():
        if name not in place:
            bounded[name] = value  # the console refuses it by its name
            continue
        axis = axes[place[name]]
        value = min(max(value, axis.minimum), axis.maximum)
        if axis.kind == "goal" and axis.wrap is None and measured:
            number, far = place[name], REACH_SHARE * axis.reach
            goal = applied[number] if applied else None
            ends = (measured[number] - far, measured[number] + far, *([] if goal is None else [goal]))
            value = min(max(value, min(ends)), max(ends))
        bounded[name] = value
    return bounded
