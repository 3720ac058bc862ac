"""The map and the navigation of a robot, as its adapter reports them (docs/robot-link.md, "Maps")."""

from collections.abc import Sequence
from typing import NamedTuple

__all__ = ["GridMap", "NavigationNow", "PlanarPose"]

PlanarPose = tuple[float, float, float]  # x (m), y (m), yaw (rad)


class GridMap(NamedTuple):
    """An occupancy grid. An adapter returns the same object until it has another map."""

    width: int  # cells along x
    height: int  # cells along y
    resolution: float  # m, the side of a cell
    origin: PlanarPose  # pose of the outer corner of cell (0, 0) in the map's frame
    cells: bytes  # one byte per cell, along x and then along y: 0 (free) to 100 (occupied), 255 (not known)
    time: float  # s, `control.clock.now` when the robot got or made it


class NavigationNow(NamedTuple):
    """Where the robot is on its map, and where it is going."""

    frame: PlanarPose | None  # of the frame of the measured pose, in the map's frame; None: not known now
    goal: PlanarPose | None = None  # in the map's frame; None: it goes nowhere
    path: Sequence[tuple[float, float]] = ()  # m, in the map's frame, from the robot on
    path_time: float = 0.0  # s, `control.clock.now` when it was planned
