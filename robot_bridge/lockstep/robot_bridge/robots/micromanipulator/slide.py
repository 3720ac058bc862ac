"""Draws the slide under the microscope without the needle: glass and drops of gel, in colour and out of focus."""

from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.micromanipulator.blur import BlurredPlanes, blurred
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO, SAMPLES, Sample

__all__ = ["Slide"]

Plane = npt.NDArray[np.float32]

GLASS: Final = (0.74, 0.78, 0.76)  # red, green, blue
RULING: Final = 50 * MICRO  # m between the lines on the glass
RULED: Final = 0.07  # darkening of a line
SUN: Final = np.array((0.45, 0.55, 0.70), np.float32)  # towards the light: ahead, left and above
CORNERS: Final = 0.55  # share of the light in the corners
SCRATCHES: Final = 5
SPECKS: Final = 45
DROP_HEIGHT: Final = 6 * MICRO  # m, height at which drops are sharpest


class Slide:
    """All of the slide that can be seen. Its parts in sight are `width` by `height` pixels."""

    def __init__(self, width: int, height: int, scale: float, margins: tuple[int, int] = (0, 0)) -> None:
        """`scale`: m per pixel. `margins`: rows and columns by which the part in sight can be moved from the origin."""
        self._shape = (height, width)
        self._margins = margins
        whole_height, whole_width = height + 2 * margins[0], width + 2 * margins[1]
        rows, columns = np.mgrid[0:whole_height, 0:whole_width].astype(np.float32)
        self.x = (whole_height / 2 - 0.5 - rows) * np.float32(scale)  # forward is up
        self.y = (whole_width / 2 - 0.5 - columns) * np.float32(scale)  # left is left
        random = np.random.default_rng(20)
        glass = self._glass(random)
        drops = self._drops(random)
        self._cover = drops["cover"]
        self._glass_degrees = BlurredPlanes(glass)
        self._drop_degrees = BlurredPlanes(drops)
        rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
        distance = (rows / height - 0.5) ** 2 + (columns / width - 0.5) ** 2
        self.vignette: Plane = 1.0 - (1.0 - np.float32(CORNERS)) * (2.0 * distance) ** 1.5

    def cover(self, moved: tuple[int, int]) -> Plane:
        """Return what is in sight: 1 on drops, 0 on glass. `moved`: see `seen`."""
        return self._cover[self._sight(moved)]

    def seen(
        self, glass_blur: float, drop_blur: float, light: float, moved: tuple[int, int] = (0, 0)
    ) -> tuple[Plane, Plane, Plane]:
        """Return red, green and blue, 0 to 1 and brighter, with the lens' shading.

        `light`: 1 is as usual. `moved`: rows down and columns to the right from the origin, within the margins.
        """
        sight = self._sight(moved)
        glass, drops = self._glass_degrees.at(glass_blur, sight), self._drop_degrees.at(drop_blur, sight)
        through = (1.0 - drops["cover"]) * self.vignette * np.float32(light)
        shaded = self.vignette * np.float32(light)
        red, green, blue = (glass["grey"] * tint * through + drops[name] * shaded for tint, name in _tints())
        return red, green, blue

    def _sight(self, moved: tuple[int, int]) -> tuple[slice, slice]:
        top, left = (min(max(margin + by, 0), 2 * margin) for margin, by in zip(self._margins, moved, strict=True))
        return slice(top, top + self._shape[0]), slice(left, left + self._shape[1])

    def _glass(self, random: np.random.Generator) -> dict[str, Plane]:
        grey = np.ones(self.x.shape, np.float32)
        for place in (self.x, self.y):
            grey -= RULED * np.exp(-(((place + RULING / 2) % RULING - RULING / 2) ** 2) / (0.7 * MICRO) ** 2)
        height, width = grey.shape
        for _ in range(SPECKS):
            row, column = random.uniform(0, height), random.uniform(0, width)
            size = random.uniform(0.8, 2.6)
            _spot(grey, row, column, size, -random.uniform(0.1, 0.4))
        for _ in range(SCRATCHES):
            x, y, angle = random.uniform(-120, 120) * MICRO, random.uniform(-160, 160) * MICRO, random.uniform(0, np.pi)
            along = (self.x - x) * np.cos(angle) + (self.y - y) * np.sin(angle)
            across = (self.y - y) * np.cos(angle) - (self.x - x) * np.sin(angle)
            across = across + 3 * MICRO * np.sin(along / (30 * MICRO))
            grey -= 0.10 * np.exp(-((across / (0.6 * MICRO)) ** 2)) * (np.abs(along) < random.uniform(20, 70) * MICRO)
        cloud = blurred(np.asarray(random.standard_normal(grey.shape), np.float32), 40.0)
        grey += 0.03 * np.clip(cloud / np.float32(cloud.std()), -2, 2)  # it is larger at the edges, which repeat
        return {"grey": grey}

    def _drops(self, random: np.random.Generator) -> dict[str, Plane]:
        cover = np.zeros(self.x.shape, np.float32)
        colours = {name: np.zeros(self.x.shape, np.float32) for _, name in _tints()}
        grain = blurred(np.asarray(random.standard_normal(self.x.shape), np.float32), 1.5)
        grain /= grain.std()
        for sample in SAMPLES:
            inside, brightness = self._drop(sample, grain)
            cover = np.maximum(cover, inside)
            for (_, name), share in zip(_tints(), sample.rgb, strict=True):
                colours[name] = colours[name] * (1 - inside) + inside * np.clip(share * brightness, 0, 1.2)
        return {**colours, "cover": cover}

    def _drop(self, sample: Sample, grain: Plane) -> tuple[Plane, Plane]:
        """Return the cover of a drop (0 to 1) and its brightness."""
        dx, dy = (self.x - sample.x) / sample.radius, (self.y - sample.y) / sample.radius
        angle = np.arctan2(dy, dx)
        ripple = 1.0 + 0.025 * np.sin(3 * angle + sample.x / MICRO) + 0.015 * np.sin(5 * angle)
        distance = np.sqrt(dx * dx + dy * dy) / ripple
        inside = np.clip((1.0 - distance) * sample.radius / (0.8 * MICRO) + 0.5, 0, 1).astype(np.float32)
        slope = 2.0 * sample.height / sample.radius
        length = np.sqrt(1.0 + (slope * slope) * (dx * dx + dy * dy))
        facing = (SUN[0] * slope * dx + SUN[1] * slope * dy + SUN[2]) / length
        gleam = np.maximum(facing / np.linalg.norm(SUN), 0) ** 40
        rim = np.exp(-(((distance - 0.97) / 0.05) ** 2))
        core = np.exp(-(((dx + 0.15) ** 2 + (dy - 0.1) ** 2) / 0.04))
        brightness = 0.55 + 0.55 * facing + 0.45 * gleam - 0.35 * rim - 0.16 * core + 0.035 * grain
        return inside, brightness.astype(np.float32)


def _tints() -> tuple[tuple[np.float32, str], ...]:
    return tuple((np.float32(tint), name) for tint, name in zip(GLASS, ("red", "green", "blue"), strict=True))


def _spot(plane: Plane, row: float, column: float, size: float, change: float) -> None:
    reach = int(size * 3) + 1
    top, left = max(0, int(row) - reach), max(0, int(column) - reach)
    part = plane[top : int(row) + reach, left : int(column) + reach]
    rows, columns = np.mgrid[top : top + part.shape[0], left : left + part.shape[1]]
    part += change * np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / (size * size)).astype(np.float32)
