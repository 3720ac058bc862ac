"""Computes the distance that axes need to stop, and the share of their values that keeps it within bounds.

An axis that is `offset` from rest goes `offset * reaction` before braking takes effect and `offset² / (2 brake)` while
it brakes. Scaled by a share `k`, that is `k * linear + k² * square`.
"""

import math
from typing import NamedTuple

__all__ = ["Demand", "doubt", "share_of", "travel"]


class Demand(NamedTuple):
    """The stopping distance of `axes` together against one limit, in this tick."""

    limit: str  # name of the limit
    axes: tuple[int, ...]  # indices of the axes that are slowed if the distance is too long
    linear: float  # distance in the joint's unit
    square: float
    room: float  # the remaining room; below 0 when the bound was passed
    is_blind: bool = False  # the position is not known


def doubt(limit: str, axes: tuple[int, ...]) -> Demand:
    """Return the demand for an unknown position: any motion of these axes is too much."""
    return Demand(limit, axes, 1.0, 0.0, 0.0, True)


def travel(offset: float, reaction: float, brake: float) -> tuple[float, float]:
    """Return the linear and the square part of the stopping distance for `offset`."""
    speed = abs(offset)
    return speed * reaction, speed * speed / (2 * brake)


def share_of(demand: Demand) -> float:
    """Return the largest share of the values, 0 to 1, that stays within the room."""
    linear, square, room = demand.linear, demand.square, demand.room
    if linear + square <= room:
        return 1.0
    if not room > 0:
        return 0.0
    return min(1.0, 2 * room / (linear + math.sqrt(linear * linear + 4 * square * room)))
