"""Draws the view from the side: a section through slide and drops at the tip, ahead to the right."""

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.micromanipulator.description import HEADING, SIDE, SLOPE, TAPER
from lockstep.robot_bridge.robots.micromanipulator.needle import TIP_RADIUS
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO, SAMPLES
from lockstep.robot_bridge.robots.micromanipulator.yuv import Picture

if TYPE_CHECKING:
    from lockstep.robot_bridge.robots.micromanipulator.robot import MicromanipulatorState

__all__ = ["SideView"]

Plane = npt.NDArray[np.float32]
Colour = tuple[int, int, int]  # y, u, v

SKY: Final[Colour] = (58, 132, 124)
GLASS: Final[Colour] = (120, 134, 120)
STEEL: Final[Colour] = (190, 128, 126)
FOCUS: Final[Colour] = (150, 170, 90)
FLOOR_ROW: Final = 0.72  # of the picture's height, at which the glass begins
BENDING: Final = 200 * MICRO  # m, the shaft bends over this length
SOFT: Final = 5 * MICRO  # m by which a dent is wider than the tip


class SideView:
    """Draws the view from the side. Call `draw` from one thread only."""

    def __init__(self, width: int, height: int) -> None:
        self._scale = SIDE.metres_per_pixel or MICRO
        self._picture = Picture(width, height)
        self._floor = round(height * FLOOR_ROW)
        columns = np.arange(width, dtype=np.float32)
        self._from_middle = (columns - np.float32(width / 2 - 0.5)) * np.float32(self._scale)
        self._heights = (self._floor - np.arange(height, dtype=np.float32)[:, None]) * np.float32(self._scale)

    def draw(self, state: "MicromanipulatorState", event: int) -> bytes:
        """Return a yuv420p picture of the state. The tip stays in the middle."""
        x = self._from_middle + np.float32(state.tip[0])
        picture = self._picture
        picture.y[:], picture.u[:], picture.v[:] = SKY
        self._fill(self._heights < 0, GLASS)
        for sample in SAMPLES:
            aside = ((x - sample.x) ** 2 + (state.tip[1] - sample.y) ** 2) / sample.radius**2
            surface = np.float32(sample.height) * (1.0 - aside)
            if state.contact is not None and state.contact.sample is sample:
                wide = math.sqrt(TIP_RADIUS * state.contact.depth) + SOFT
                dent = np.exp(-(((x - state.tip[0]) / wide) ** 2) / 2)
                surface = surface - np.float32(state.contact.depth) * dent
            self._fill((self._heights > 0) & (self._heights < surface), _colour(sample.rgb))
        self._fill(np.abs(self._heights - state.focus) < self._scale * 0.5, FOCUS, every=4)
        self._fill(self._needle(x, state), STEEL)
        return picture.buffer.tobytes()

    def _needle(self, x: Plane, state: "MicromanipulatorState") -> npt.NDArray[np.bool_]:
        """Return the pixels of the shaft, whose bending dies out towards the holder."""
        behind = (np.float32(state.tip[0]) - x) / np.float32(-math.cos(HEADING))  # along the shaft, seen from above
        way = np.maximum(behind, 0.0)
        straight = np.float32(state.tip[2] - state.holder[2]) * np.clip(1.0 - way / BENDING, 0.0, 1.0) ** 2
        middle = np.float32(state.holder[2] + TIP_RADIUS) + way * np.float32(SLOPE) + straight
        half = np.float32(TIP_RADIUS) + np.float32(TAPER) * way
        shaft = (np.abs(self._heights - middle) < half) & (behind >= 0)
        ball = (x - np.float32(state.tip[0])) ** 2 + (self._heights - np.float32(state.tip[2] + TIP_RADIUS)) ** 2
        seen: npt.NDArray[np.bool_] = shaft | (ball < TIP_RADIUS**2)
        return seen

    def _fill(self, where: npt.NDArray[np.bool_], colour: Colour, every: int = 0) -> None:
        """Fill the pixels. `every`: length of dashes in pixels; 0 fills without dashes."""
        where = np.broadcast_to(where, self._picture.y.shape)
        if every:
            where = where & ((np.arange(where.shape[1]) // every) % 2 == 0)
        half = where[::2, ::2]
        for plane, value, mask in zip(
            (self._picture.y, self._picture.u, self._picture.v), colour, (where, half, half), strict=True
        ):
            plane[mask] = value


def _colour(rgb: tuple[float, float, float]) -> Colour:
    red, green, blue = rgb
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    return (round(16 + 219 * luma * 0.8), round(128 + 126 * (blue - luma)), round(128 + 160 * (red - luma)))
