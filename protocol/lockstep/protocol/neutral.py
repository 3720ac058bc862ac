"""Tells which values of a command move nothing, without regard to a robot's state."""

from collections.abc import Sequence

from lockstep.protocol.description import Axis

__all__ = ["has_goals", "neutral_value", "neutral_values"]


def neutral_value(axis: Axis) -> float | None:
    """Return the value that moves nothing: `rest` of a rate axis, None of a goal axis."""
    return None if axis.kind == "goal" else axis.rest


def neutral_values(axes: Sequence[Axis]) -> list[float | None]:
    """Return the values of a neutral command, one per axis."""
    return [neutral_value(axis) for axis in axes]


def has_goals(axes: Sequence[Axis]) -> bool:
    """Return whether any of the axes is a goal axis."""
    return "goal" in [axis.kind for axis in axes]  # asked of each command: `any` would resume once for each axis
