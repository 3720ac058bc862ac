"""Draws the planar robot's pictures in yuv420p, with numpy alone."""

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.event_strip import draw_event_strip, strip_height
from lockstep.robot_bridge.robots.planar.description import FIELD_OF_VIEW, RADIUS, WALL_HEIGHT
from lockstep.robot_bridge.robots.planar.room import CHARGER, HALF_LENGTH, HALF_WIDTH, PILLARS, ray_hits

if TYPE_CHECKING:
    from lockstep.robot_bridge.robots.planar.robot import PlanarState

__all__ = ["FrontDrawing", "OverviewDrawing"]

Plane = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]  # y, u, v

FLOOR: Colour = (52, 132, 124)
GRID: Colour = (66, 132, 124)
WALL: Colour = (150, 132, 124)
FORBIDDEN: Colour = (78, 116, 168)  # a zone that the robot must not enter
PILLAR: Colour = (140, 104, 158)
BODY: Colour = (130, 168, 92)
NOSE: Colour = (225, 128, 128)
FORCE: Colour = (110, 96, 212)
SKY: Colour = (36, 134, 124)


class Picture:
    """Planes of one 4:2:0 picture of even width and height, in one buffer."""

    def __init__(self, width: int, height: int) -> None:
        self.buffer = np.empty(width * height * 3 // 2, np.uint8)
        luma, quarter = width * height, width * height // 4
        self.y = self.buffer[:luma].reshape(height, width)
        self.u = self.buffer[luma : luma + quarter].reshape(height // 2, width // 2)
        self.v = self.buffer[luma + quarter :].reshape(height // 2, width // 2)

    def fill(self, colour: Colour) -> None:
        self.y[:], self.u[:], self.v[:] = colour

    def box(self, left: int, top: int, right: int, bottom: int, colour: Colour) -> None:
        """Fill a rectangle; outside parts are cut off."""
        left, top = max(left, 0), max(top, 0)
        right, bottom = max(right, left), max(bottom, top)
        self.y[top:bottom, left:right] = colour[0]
        half = (slice(top // 2, (bottom + 1) // 2), slice(left // 2, (right + 1) // 2))
        self.u[half], self.v[half] = colour[1], colour[2]

    def disc(self, x: float, y: float, radius: float, colour: Colour) -> None:
        for plane, value, scale in ((self.y, colour[0], 1.0), (self.u, colour[1], 0.5), (self.v, colour[2], 0.5)):
            height, width = plane.shape
            cx, cy, r = x * scale, y * scale, radius * scale
            left, right = max(int(cx - r), 0), min(int(cx + r) + 2, width)
            top, bottom = max(int(cy - r), 0), min(int(cy + r) + 2, height)
            if left < right and top < bottom:
                rows, columns = np.ogrid[top:bottom, left:right]
                plane[top:bottom, left:right][(columns - cx) ** 2 + (rows - cy) ** 2 <= r * r] = value

    def finish(self, event: int) -> bytes:
        """Return the bytes, with the event strip on top."""
        rows = (strip_height(self.y.shape[0]) + 1) // 2
        self.u[:rows] = self.v[:rows] = 128
        draw_event_strip(self.y, event)
        return self.buffer.tobytes()


class OverviewDrawing:
    """The room from above; x points right, y up."""

    def __init__(self, width: int, height: int) -> None:
        self._picture = Picture(width, height)
        top = strip_height(height) + 4
        self._scale = min((width - 16) / (2 * HALF_LENGTH), (height - top - 8) / (2 * HALF_WIDTH))  # pixels per m
        self._cx, self._cy = width / 2, top + (height - top - 8) / 2
        self._background = self._draw_room()

    def draw(self, state: "PlanarState", event: int) -> bytes:
        picture = self._picture
        np.copyto(picture.buffer, self._background)
        x, y = self._pixel(state.x, state.y)
        cos, sin = math.cos(state.yaw), math.sin(state.yaw)
        picture.disc(x, y, RADIUS * self._scale, BODY)
        picture.disc(x + cos * 0.2 * self._scale, y - sin * 0.2 * self._scale, 0.07 * self._scale, NOSE)
        force = math.hypot(state.fx, state.fy)
        if force > 0:
            fx, fy = cos * state.fx - sin * state.fy, sin * state.fx + cos * state.fy
            reach = -RADIUS * self._scale / force  # the force comes from the other side
            picture.disc(x + fx * reach, y - fy * reach, min(4 + force / 10, 16), FORCE)
        return picture.finish(event)

    def _pixel(self, x: float, y: float) -> tuple[float, float]:
        return self._cx + x * self._scale, self._cy - y * self._scale

    def _draw_room(self) -> Plane:
        picture = self._picture
        picture.fill(WALL)
        left, top = map(round, self._pixel(-HALF_LENGTH, HALF_WIDTH))
        right, bottom = map(round, self._pixel(HALF_LENGTH, -HALF_WIDTH))
        picture.box(left, top, right, bottom, FLOOR)
        zone_left, zone_low, zone_right, zone_high = CHARGER
        zone_x, zone_y = map(round, self._pixel(zone_left, zone_high))
        zone_end, zone_bottom = map(round, self._pixel(zone_right, zone_low))
        picture.box(zone_x, zone_y, min(zone_end, right), min(zone_bottom, bottom), FORBIDDEN)
        for metre in range(-int(HALF_LENGTH) + 1, int(HALF_LENGTH)):
            column = round(self._pixel(metre, 0)[0])
            picture.box(column, top, column + 1, bottom, GRID)
        for metre in range(-int(HALF_WIDTH) + 1, int(HALF_WIDTH)):
            row = round(self._pixel(0, metre)[1])
            picture.box(left, row, right, row + 1, GRID)
        for px, py, radius in PILLARS.tolist():
            picture.disc(*self._pixel(px, py), radius * self._scale, PILLAR)
        return picture.buffer.copy()


class FrontDrawing:
    """The view ahead of the robot: one ray per pair of columns, walls and pillars by distance."""

    def __init__(self, width: int, height: int) -> None:
        self._picture = Picture(width, height)
        columns = np.arange(width // 2) - (width // 2 - 1) / 2
        self._focal = (width / 2) / math.tan(FIELD_OF_VIEW / 2)  # pixels
        self._angles = -np.arctan(2 * columns / self._focal)
        self._from_middle = np.abs(np.arange(height) - (height - 1) / 2)[:, None]
        self._below = (np.arange(height) >= height // 2)[:, None]

    def draw(self, state: "PlanarState", event: int) -> bytes:
        distances, pillar = ray_hits(state.x, state.y, state.yaw + self._angles)
        depth = np.maximum(distances * np.cos(self._angles), 0.05)
        half_height = WALL_HEIGHT / 2 * self._focal / depth
        solid = self._from_middle <= half_height
        shade = np.clip(1.15 - 0.09 * depth, 0.3, 1.0)
        luma = np.where(pillar, PILLAR[0], WALL[0]) * shade
        picture = self._picture
        drawn = np.where(solid, luma, np.where(self._below, FLOOR[0], SKY[0])).astype(np.uint8)
        picture.y[:, 0::2] = picture.y[:, 1::2] = drawn
        coloured = solid[::2] & pillar
        picture.u[:] = np.where(coloured, PILLAR[1], WALL[1])
        picture.v[:] = np.where(coloured, PILLAR[2], WALL[2])
        return picture.finish(event)
