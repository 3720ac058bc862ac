"""Computes the needle's outline under the microscope: thin and sharp at the tip, wide and out of focus up the shaft."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.micromanipulator.description import HEADING, SLOPE, TAPER
from lockstep.robot_bridge.robots.micromanipulator.needle import TIP_RADIUS

if TYPE_CHECKING:
    from lockstep.robot_bridge.robots.micromanipulator.robot import MicromanipulatorState

__all__ = ["Outline", "Window", "outline"]

Plane = npt.NDArray[np.floating[Any]]

ALONG: Final = (math.cos(HEADING), math.sin(HEADING))  # from the tip to the holder, x and y
FREE_LENGTH: Final = 320e-6  # m, the shaft bends over this length


class Window(NamedTuple):
    """The part of the picture to draw on; its bounds are even numbers."""

    top: int
    left: int
    bottom: int
    right: int


class Outline(NamedTuple):
    window: Window
    cover: Plane  # 0 to 1
    across: Plane  # -1 to 1 over the shaft's width, for the gleam on it


def outline(
    state: "MicromanipulatorState",
    shape: tuple[int, int],
    scale: float,
    blur: Callable[[Plane], Plane],
    shift: tuple[float, float] = (0.0, 0.0),
    *,
    shadow: bool = False,
) -> Outline | None:
    """Return the outline of the needle or of its shadow; None if it is out of sight.

    `shift`: displacement of the shadow, x and y per metre of height. `blur`: returns the unsharpness in m at a height
    above the glass. `scale`: m per pixel. `shape`: height, width in pixels.
    """
    height, width = shape
    reach = math.hypot(height, width) * scale
    far = np.array((0.0, reach), np.float32)
    centre_x, centre_y, heights = _centre(state, far, shift if shadow else None)
    spread = float(np.max(_half_width(far) + 2.2 * blur(heights)))
    window = _window(centre_x, centre_y, spread, shape, scale)
    if window is None:
        return None
    rows = np.arange(window.top, window.bottom, dtype=np.float32)[:, None]
    columns = np.arange(window.left, window.right, dtype=np.float32)[None, :]
    x = (height / 2 - 0.5 - rows) * np.float32(scale)
    y = (width / 2 - 0.5 - columns) * np.float32(scale)
    rise = SLOPE if shadow else 0.0
    ahead_x, ahead_y = ALONG[0] + shift[0] * rise, ALONG[1] + shift[1] * rise
    length = math.hypot(ahead_x, ahead_y)
    unit_x, unit_y = np.float32(ahead_x / length), np.float32(ahead_y / length)
    tip_x, tip_y = float(centre_x[0]), float(centre_y[0])
    along = (x - np.float32(tip_x)) * unit_x + (y - np.float32(tip_y)) * unit_y
    aside = (y - np.float32(tip_y)) * unit_x - (x - np.float32(tip_x)) * unit_y
    bend_x, bend_y = state.tip[0] - state.holder[0], state.tip[1] - state.holder[1]
    sideways = np.float32(bend_y * float(unit_x) - bend_x * float(unit_y))
    if abs(sideways) > 0.0:
        aside = aside + sideways * (1.0 - _deflection(along / np.float32(length)))
    way = along / np.float32(length)
    soft = blur(np.float32(state.tip[2]) + np.maximum(way, 0.0) * np.float32(SLOPE)) + np.float32(0.35 * scale)
    half = _half_width(way)
    cover = _edge((half - aside) / soft) - _edge((-half - aside) / soft)
    cover *= _edge((along + np.float32(TIP_RADIUS)) / soft)
    return Outline(window, cover, aside / half)


def _centre(
    state: "MicromanipulatorState", ways: Plane, shift: tuple[float, float] | None
) -> tuple[Plane, Plane, Plane]:
    """Return x, y and height of the shaft's middle as it is seen, `ways` metres behind the tip."""
    heights = np.maximum(np.float32(state.tip[2]) + ways * np.float32(SLOPE), 0.0)
    x, y = state.tip[0] + ways * np.float32(ALONG[0]), state.tip[1] + ways * np.float32(ALONG[1])
    if shift is not None:
        x, y = x + heights * np.float32(shift[0]), y + heights * np.float32(shift[1])
    return x, y, heights


def _half_width(ways: Plane) -> Plane:
    width: Plane = np.float32(TIP_RADIUS) * 0.6 + np.float32(TAPER) * np.maximum(ways, np.float32(0.0))
    return width


def _deflection(ways: Plane) -> Plane:
    """Return the deflection of a cantilever loaded at its end: 1 at the tip, 0 at the holder."""
    share = np.clip(ways / np.float32(FREE_LENGTH), 0.0, 1.0)
    bent: Plane = 1.0 - 1.5 * share + 0.5 * share**3
    return bent


def _edge(distance: Plane) -> Plane:
    """Return 0 outside to 1 inside, smooth like a blurred edge, but cheap."""
    cut = np.clip(distance * np.float32(0.5), -1.0, 1.0)
    rounded: Plane = np.float32(0.5) + cut * (np.float32(0.75) - np.float32(0.25) * cut * cut)
    return rounded


def _window(xs: Plane, ys: Plane, spread: float, shape: tuple[int, int], scale: float) -> Window | None:
    height, width = shape
    rows = height / 2 - xs / np.float32(scale)
    columns = width / 2 - ys / np.float32(scale)
    margin = spread / scale + 4
    top, bottom = _even(float(rows.min()) - margin, height), _even(float(rows.max()) + margin, height)
    left, right = _even(float(columns.min()) - margin, width), _even(float(columns.max()) + margin, width)
    return Window(top, left, bottom, right) if bottom > top and right > left else None


def _even(place: float, most: int) -> int:
    return min(max(int(place) // 2 * 2, 0), most)
