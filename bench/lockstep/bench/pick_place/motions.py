"""The motions of the tool and the gripper that put a block of the SO-101's scene into its bowl. No I/O, no clock."""

import math
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

__all__ = ["BLOCKS", "BOWL", "POSITION", "ROTATION", "Motion", "Place", "motions"]


class Place(NamedTuple):
    x: float  # m
    y: float
    yaw: float  # rad


BLOCKS: Final[Mapping[str, Place]] = {  # robots/so101/scene.xml
    "red": Place(0.25, -0.09, 0.0),
    "green": Place(0.29, 0.01, math.radians(20)),
    "blue": Place(0.20, -0.03, math.radians(-35)),
}
BOWL: Final = (0.20, 0.16)  # m
BESIDE: Final[Mapping[str, tuple[float, float]]] = {  # m, where three blocks lie beside each other in it
    "red": (0.220, 0.160),
    "green": (0.190, 0.178),
    "blue": (0.190, 0.142),
}
AXIS: Final = 0.0388  # m, where the arm pans about: a block's side that faces it is gripped
GRIP, ABOVE, OVER_BOWL, CARRY = 0.016, 0.08, 0.085, 0.13  # m, height of the tool
OPEN, SHUT = 0.75, -0.10  # rad, of the gripper
POSITION: Final = ("tool.x", "tool.y", "tool.z")
ROTATION: Final = ("tool.rx", "tool.ry", "tool.rz")


class Motion(NamedTuple):
    name: str  # what it does, for people
    goals: dict[str, float]  # by axis: of the tool, in m and rad, or of the gripper
    must_arrive: bool  # the tool, measured


def motions(name: str, place: Place | None = None, bowl: tuple[float, float] | None = None) -> Iterator[Motion]:
    """Yield the motions for the block of this name, one of BLOCKS.

    Args:
        place: of the block; None: where the scene begins
        bowl: m, where to let go of it; None: beside the other blocks in the bowl
    """
    block, bowl = place or BLOCKS[name], bowl or BESIDE[name]
    facing = math.atan2(block.y, block.x - AXIS)
    quarter = math.pi / 2
    aligned = (block.yaw - facing + quarter / 2) % quarter - quarter / 2 + facing
    down = dict(zip(ROTATION, _pointing_down(aligned), strict=True))
    over = dict(zip(ROTATION, _pointing_down(math.atan2(bowl[1], bowl[0] - AXIS)), strict=True))
    yield Motion("opens the fingers", {"gripper": OPEN}, must_arrive=False)
    yield Motion("goes above the block", _at(block.x, block.y, ABOVE) | down, must_arrive=True)
    yield Motion("goes down to the block", _at(block.x, block.y, GRIP) | down, must_arrive=True)
    yield Motion("closes the fingers", {"gripper": SHUT}, must_arrive=False)
    yield Motion("lifts the block", _at(block.x, block.y, CARRY) | down, must_arrive=True)
    yield Motion("carries it above the bowl", _at(*bowl, CARRY) | over, must_arrive=True)
    yield Motion("goes down into the bowl", _at(*bowl, OVER_BOWL) | over, must_arrive=True)
    yield Motion("lets go of the block", {"gripper": OPEN}, must_arrive=False)
    yield Motion("goes up", _at(*bowl, CARRY) | over, must_arrive=True)


def _at(x: float, y: float, z: float) -> dict[str, float]:
    return dict(zip(POSITION, (x, y, z), strict=True))


def _pointing_down(yaw: float) -> tuple[float, float, float]:
    """Return the rotation vector of a tool that points down, turned by `yaw` about the vertical.

    It is a quarter turn about y and then the yaw about z, composed as quaternions.
    """
    half, turn = math.pi / 4, yaw / 2
    w, x, y, z = (
        math.cos(turn) * math.cos(half),
        -math.sin(turn) * math.sin(half),
        math.cos(turn) * math.sin(half),
        math.sin(turn) * math.cos(half),
    )
    length = math.hypot(x, y, z)
    angle = 2 * math.atan2(length, w)
    return (x / length * angle, y / length * angle, z / length * angle)
