"""The planar robot's world: a rectangular room with round pillars and a charging corner. Geometry only."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["CHARGER", "DOCK", "HALF_LENGTH", "HALF_WIDTH", "PILLARS", "Contact", "contacts", "ray_hits"]

HALF_LENGTH = 4.0  # m, walls at x = ±
HALF_WIDTH = 3.0  # m, walls at y = ±
PILLARS = np.array([[2.0, 1.2, 0.35], [-1.8, -1.0, 0.5], [-1.5, 1.8, 0.25]])  # x, y, radius (m)
CHARGER = (2.8, -3.1, 4.1, -2.0)  # m, left, low, right, high: a zone that is forbidden; reaches into the walls
DOCK = (3.3, -1.58, -np.pi / 2)  # x, y (m) and yaw (rad): in front of that zone, facing it, where the robot charges

FloatArray = npt.NDArray[np.float64]


class Contact(NamedTuple):
    """A contact of the robot with an obstacle: its depth (m), and the unit normal that points out of the obstacle."""

    depth: float
    nx: float
    ny: float


def contacts(x: float, y: float, radius: float) -> list[Contact]:
    """Return all contacts of a disc at (x, y)."""
    found = [
        Contact(depth, nx, ny)
        for depth, nx, ny in (
            (x + radius - HALF_LENGTH, -1.0, 0.0),
            (-x + radius - HALF_LENGTH, 1.0, 0.0),
            (y + radius - HALF_WIDTH, 0.0, -1.0),
            (-y + radius - HALF_WIDTH, 0.0, 1.0),
        )
        if depth > 0
    ]
    for px, py, pillar_radius in PILLARS.tolist():
        dx, dy = x - px, y - py
        distance = float(np.hypot(dx, dy))
        depth = radius + pillar_radius - distance
        if depth > 0:
            nx, ny = (dx / distance, dy / distance) if distance > 0 else (1.0, 0.0)
            found.append(Contact(depth, nx, ny))
    return found


def ray_hits(x: float, y: float, angles: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Return the distance from (x, y) to the first wall or pillar along each angle (rad), and True for pillars."""
    cos, sin = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        to_x = (np.copysign(HALF_LENGTH, cos) - x) / np.where(cos == 0, 1e-12, cos)
        to_y = (np.copysign(HALF_WIDTH, sin) - y) / np.where(sin == 0, 1e-12, sin)
    walls = np.minimum(np.abs(to_x), np.abs(to_y))
    dx, dy = PILLARS[:, 0:1] - x, PILLARS[:, 1:2] - y
    along = dx * cos + dy * sin
    squared = PILLARS[:, 2:3] ** 2 - (dx * dx + dy * dy - along * along)
    entry = along - np.sqrt(np.maximum(squared, 0.0))
    pillars = np.where((squared > 0) & (entry > 0), entry, np.inf).min(axis=0)
    return np.minimum(walls, pillars), pillars < walls
