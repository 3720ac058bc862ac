"""Which entry of the leader's action drives which axis, and by how much. No I/O."""

from collections.abc import Sequence
from typing import NamedTuple

from lockstep.protocol.description import RobotDescription

__all__ = ["BadMapping", "Mapping", "map_axes"]


class BadMapping(ValueError):
    """A mapping names something that is not there."""


class Mapping(NamedTuple):
    names: list[str]  # of the leader's entries
    scales: dict[str, float]  # axes, in the same order, with the goal per motion of the leader


def map_axes(description: RobotDescription, names: Sequence[str], given: Sequence[str]) -> Mapping:
    """Return what drives what: entries and axes of the same name, and those that are given.

    Args:
        names: the entries of the leader's action
        given: "ENTRY=AXIS" or "ENTRY=AXIS*SCALE"

    Raises:
        BadMapping: an entry or axis does not exist, an axis is driven twice, or there is nothing to drive.
    """
    axes = [axis.name for axis in description.axes if axis.kind == "goal"]
    chosen: dict[str, tuple[str, float]] = {name: (name, 1.0) for name in names if name in axes}
    for word in given:
        entry, _, target = word.partition("=")
        axis, _, scale = target.partition("*")
        if entry not in names:
            raise BadMapping(f"{word}: the leader has no {entry!r}; it has {', '.join(names)}")
        if axis not in axes:
            raise BadMapping(f"{word}: the robot has no goal axis {axis!r}; it has {', '.join(axes) or 'none'}")
        try:
            chosen[entry] = (axis, float(scale or 1.0))
        except ValueError as error:
            raise BadMapping(f"{word}: {scale!r} is not a number") from error
    if not chosen:
        raise BadMapping(
            f"the leader has {', '.join(names)} and the robot {', '.join(axes) or 'no goal axes'}: "
            "name pairs with --map ENTRY=AXIS*SCALE"
        )
    scales = dict(chosen.values())
    if len(scales) < len(chosen):
        raise BadMapping("two entries of the leader drive the same axis")
    return Mapping(list(chosen), scales)
