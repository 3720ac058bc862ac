"""How far axes go before they can stand still, and the share of their values that keeps this within bounds.

An axis that is `offset` from rest goes `offset * reaction` before braking takes effect and `offset² / (2 brake)` while
it brakes. Scaled by a share `k`, that is `k * linear + k² * square`.
"""

import math
from typing import NamedTuple

__all__ = ["Demand", "doubt", "share_of", "travel"]


class Demand(NamedTuple):
    """What `axes`, all together, ask of one limit in this tick."""

    limit: str  # name of the limit
    axes: tuple[int, ...]  # indices of the axes that are slowed when it is too much
    linear: float  # distance in the joint's unit
    square: float
    room: float  # the remaining room; below 0 when the bound was passed
    is_blind: bool = False  # the position is not known


def doubt(limit: str, axes: tuple[int, ...]) -> Demand:
    """The position is unknown: any motion of these axes is too much."""
    return Demand(limit, axes, 1.0, 0.0, 0.0, True)


def travel(offset: float, reaction: float, brake: float) -> tuple[float, float]:
    """The linear and the square part of the distance that `offset` leads to."""
    speed = abs(offset)
    return speed * reaction, speed * speed / (2 * brake)


def share_of(demand: Demand) -> float:
    """The largest share of the values, 0 to 1, that stays within the room."""
    linear, square, room = demand.linear, demand.square, demand.room
    if linear + square <= room:
        return 1.0
    if not room > 0:
        return 0.0
    return min(1.0, 2 * room / (linear + math.sqrt(linear * linear + 4 * square * room)))
