"""Bounds a command's goals to what the robot takes. No I/O."""

from collections.abc import Mapping, Sequence

from lockstep.client.control.clutch import REACH_SHARE
from lockstep.protocol.description import Axis

__all__ = ["within_reach"]


def within_reach(axes: Sequence[Axis], measured: Sequence[float], wanted: Mapping[str, float]) -> dict[str, float]:
    """Return the values with each goal no further from the measured value than the robot accepts, and in its range.

    A goal beyond an axis' `reach` would be refused as a jump, and with it the whole command. Values of rate axes and
    of axes with `wrap` are bounded by their range alone.
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
            far = REACH_SHARE * axis.reach
            value = min(max(value, measured[place[name]] - far), measured[place[name]] + far)
        bounded[name] = value
    return bounded
