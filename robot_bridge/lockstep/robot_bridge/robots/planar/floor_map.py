"""The planar robot's map of its room: what a laser scanner would have mapped. Geometry only."""

import math

import numpy as np

from lockstep.robot_bridge.robots.navigation import GridMap
from lockstep.robot_bridge.robots.planar.room import CHARGER, HALF_LENGTH, HALF_WIDTH, PILLARS

__all__ = ["has_room", "make_map"]

RESOLUTION = 0.05  # m
BORDER = 0.2  # m of the map around the room
WALL = 0.1  # m, thickness of what is mapped of a wall
FREE, OCCUPIED, UNKNOWN = 0, 100, 255


def make_map(now: float) -> GridMap:
    """Return the map. `now`: s, the time that it has."""
    width, height = (round(2 * (half + BORDER) / RESOLUTION) for half in (HALF_LENGTH, HALF_WIDTH))
    left, low = -HALF_LENGTH - BORDER, -HALF_WIDTH - BORDER
    x = left + (np.arange(width) + 0.5) * RESOLUTION
    y = low + ((np.arange(height) + 0.5) * RESOLUTION)[:, None]
    beyond = np.maximum(np.abs(x) - HALF_LENGTH, np.abs(y) - HALF_WIDTH)  # m behind the nearest wall
    cells = np.where(beyond <= 0, FREE, np.where(beyond <= WALL, OCCUPIED, UNKNOWN)).astype(np.uint8)
    for px, py, radius in PILLARS.tolist():
        away = np.hypot(x - px, y - py)
        cells[away <= radius] = OCCUPIED
        cells[away <= radius - WALL] = UNKNOWN  # no scanner sees into a pillar
    return GridMap(width, height, RESOLUTION, (left, low, 0.0), cells.tobytes(), now)


def has_room(x: float, y: float, radius: float) -> bool:
    """Return whether a disc fits there: inside the walls, beside the pillars, outside the forbidden zone."""
    if abs(x) > HALF_LENGTH - radius or abs(y) > HALF_WIDTH - radius:
        return False
    if any(math.hypot(x - px, y - py) < radius + pillar for px, py, pillar in PILLARS.tolist()):
        return False
    left, low, right, high = CHARGER
    return math.hypot(max(left - x, 0.0, x - right), max(low - y, 0.0, y - high)) >= radius
