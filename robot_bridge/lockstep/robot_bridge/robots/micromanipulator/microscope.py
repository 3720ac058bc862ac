"""The microscope's picture: the slide, dented where the needle pushes, the needle and its shadow, and some grain."""

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.micromanipulator.dent import draw_dent
from lockstep.robot_bridge.robots.micromanipulator.description import MICROSCOPE, WINDOWS
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO
from lockstep.robot_bridge.robots.micromanipulator.shaft import Outline, outline
from lockstep.robot_bridge.robots.micromanipulator.slide import DROP_HEIGHT, Slide
from lockstep.robot_bridge.robots.micromanipulator.yuv import Picture, picture_of

if TYPE_CHECKING:
    from lockstep.robot_bridge.robots.micromanipulator.robot import MicromanipulatorState

__all__ = ["Microscope", "blur_at"]

Plane = npt.NDArray[np.float32]

DEPTH_OF_FIELD: Final = 3.5 * MICRO  # m, of a lens of 20x with the aperture below
APERTURE: Final = math.tan(math.asin(0.28)) / 2  # m of unsharpness per m out of focus
SHADOW: Final = (-0.42, -0.50)  # x and y by which a shadow is displaced, per height of what casts it
SHADOW_SOFT: Final = (0.6 * MICRO, 0.10)  # m, and m per m of height
SHADOW_DARK: Final = 0.34
STEEL: Final = 62  # luma of the needle, and below, the excess of its middle
GLEAM: Final = 150
GRAINS: Final = 4
FOCUS_STEP: Final = 0.5 * MICRO  # m; finer differences of focus cannot be seen


class Microscope:
    """Draws the microscope's pictures. Call `draw` from one thread only."""

    def __init__(self, width: int, height: int) -> None:
        self._shape = (height, width)
        self._scale = MICROSCOPE.metres_per_pixel or MICRO
        margins = [math.ceil(WINDOWS[joint][1] / self._scale) for joint in ("view.x", "view.y")]
        self._slide = Slide(width, height, self._scale, (margins[0], margins[1]))
        self._empty: Picture | None = None  # the slide alone, as it was drawn last
        self._empty_key = (0, 0, (0, 0))
        random = np.random.default_rng(7)
        grains = np.round(random.normal(0.0, 1.3, (GRAINS, height, width))).astype(np.int8)
        self._grains = np.clip(grains, -4, 4).view(np.uint8)  # as bytes that wrap: luma never comes near the ends
        self._count = 0

    def draw(self, state: "MicromanipulatorState", event: int) -> bytes:
        """Return a yuv420p picture of the state."""
        moved = (-round(state.view[0] / self._scale), -round(state.view[1] / self._scale))  # rows, columns
        slide = self._seen_slide(state, moved)
        picture = slide.copy()
        state = _from_middle(state, moved, self._scale)
        draw_dent(picture, slide, self._slide.cover(moved), state, self._scale)
        shadow = outline(state, self._shape, self._scale, _shadow_blur, SHADOW, shadow=True)
        if shadow is not None:
            _darken(picture, shadow)
        needle = outline(state, self._shape, self._scale, lambda heights: blur_at(heights - state.focus))
        if needle is not None:
            self._lay(picture, needle, state.light)
        self._count = (self._count + 1) % GRAINS
        picture.y += self._grains[self._count]
        return picture.buffer.tobytes()

    def _seen_slide(self, state: "MicromanipulatorState", moved: tuple[int, int]) -> Picture:
        key = (round(state.focus / FOCUS_STEP), round(state.light), moved)
        if self._empty is None or key != self._empty_key:
            glass, drops = (
                float(blur_at(np.float32(away))) / self._scale for away in (state.focus, state.focus - DROP_HEIGHT)
            )
            seen = self._slide.seen(glass, drops, state.light / 100, moved)
            self._empty, self._empty_key = picture_of(*(np.clip(plane, 0.03, 0.97) for plane in seen)), key
        return self._empty

    def _lay(self, picture: Picture, needle: Outline, light: float) -> None:
        """Draw the needle over the picture: steel, bright along its middle, as dark as the lens makes the corners."""
        window, cover, across = needle
        part = np.s_[window.top : window.bottom, window.left : window.right]
        shade = self._slide.vignette[part] * np.float32(min(light, 115.0) / 100)
        round_off = np.maximum(1.0 - (across - np.float32(0.25)) ** 2 * np.float32(1.6), 0.0)
        luma = 18.0 + (STEEL + GLEAM * round_off * round_off) * shade
        under = picture.y[part]
        under[:] = under + (luma - under) * cover
        half = np.s_[window.top // 2 : window.bottom // 2, window.left // 2 : window.right // 2]
        weaker = 1.0 - cover[::2, ::2]
        for plane in (picture.u, picture.v):
            plane[half] = 128.0 + (plane[half] - np.float32(128.0)) * weaker


def _from_middle(state: "MicromanipulatorState", moved: tuple[int, int], scale: float) -> "MicromanipulatorState":
    """Return the state as it would be if its places were measured from what the middle of the picture shows."""
    x, y = (pixels * scale for pixels in moved)
    tip, holder = state.tip, state.holder
    return state._replace(tip=(tip[0] + x, tip[1] + y, tip[2]), holder=(holder[0] + x, holder[1] + y, holder[2]))


def blur_at(away: Plane | np.float32) -> Plane:
    """Return the unsharpness in m at a distance `away` from the focus."""
    beyond = np.maximum(np.abs(away) - np.float32(DEPTH_OF_FIELD / 2), np.float32(0.0))
    soft: Plane = beyond * np.float32(APERTURE)
    return soft


def _shadow_blur(heights: Plane) -> Plane:
    soft: Plane = np.float32(SHADOW_SOFT[0]) + np.float32(SHADOW_SOFT[1]) * np.maximum(heights, np.float32(0.0))
    return soft


def _darken(picture: Picture, shadow: Outline) -> None:
    window = shadow.window
    part = picture.y[window.top : window.bottom, window.left : window.right]
    part[:] = 16.0 + (part - np.float32(16.0)) * (1.0 - np.float32(SHADOW_DARK) * shadow.cover)
