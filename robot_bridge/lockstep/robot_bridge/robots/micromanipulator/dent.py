"""Draws a drop under the needle: pressed in, dragged along, and so lit differently."""

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.micromanipulator.needle import TIP_RADIUS
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO
from lockstep.robot_bridge.robots.micromanipulator.yuv import Picture

if TYPE_CHECKING:
    from lockstep.robot_bridge.robots.micromanipulator.robot import MicromanipulatorState

__all__ = ["draw_dent"]

Plane = npt.NDArray[np.floating[Any]]

REACH: Final = 34 * MICRO  # m around the tip within which a drop is seen to give way
SHADING: Final = 95.0  # luma per slope
PULL: Final = 0.40  # pull of the surface towards the tip, per depth of the dent
LIGHT: Final = (0.63, 0.77)  # direction that it comes from, x and y


def draw_dent(picture: Picture, slide: Picture, cover: Plane, state: "MicromanipulatorState", scale: float) -> None:
    """Draw the dent in the touched drop. Without one draw nothing: glass does not give way."""
    contact = state.contact
    if contact is None or contact.sample is None:
        return
    height, width = picture.y.shape
    row, column = height / 2 - 0.5 - state.tip[0] / scale, width / 2 - 0.5 - state.tip[1] / scale
    reach = int(REACH / scale)
    top, bottom = max(0, (int(row) - reach) // 2 * 2), min(height, (int(row) + reach) // 2 * 2)
    left, right = max(0, (int(column) - reach) // 2 * 2), min(width, (int(column) + reach) // 2 * 2)
    if bottom <= top or right <= left:
        return
    rows = np.arange(top, bottom, dtype=np.float32)[:, None] - np.float32(row)
    columns = np.arange(left, right, dtype=np.float32)[None, :] - np.float32(column)
    square = rows * rows + columns * columns
    depth = contact.depth / scale  # all in pixels from here
    wide = (math.sqrt(TIP_RADIUS * contact.depth) + 5.0 * MICRO) / scale
    dent = np.exp(-square / np.float32(2 * wide * wide)) * cover[top:bottom, left:right]
    far = REACH / scale
    fade = np.clip(1.0 - square / np.float32(far * far), 0.0, 1.0) ** 2 * cover[top:bottom, left:right]
    # Dragged material comes from behind the tip; drawn-in material comes from farther out.
    inward = np.float32(PULL * depth / wide) * dent
    from_rows = rows * (1.0 + inward) + np.float32(contact.drag[0] / scale) * fade
    from_columns = columns * (1.0 + inward) + np.float32(contact.drag[1] / scale) * fade
    _warp(picture.y[top:bottom, left:right], slide.y, from_rows + np.float32(row), from_columns + np.float32(column))
    for plane, source in ((picture.u, slide.u), (picture.v, slide.v)):
        target = plane[top // 2 : bottom // 2, left // 2 : right // 2]
        _warp(
            target,
            source,
            (from_rows[::2, ::2] + np.float32(row)) / 2,
            (from_columns[::2, ::2] + np.float32(column)) / 2,
        )
    # The dent's slope towards the light is darker, the far side brighter.
    slope = dent * np.float32(depth / (wide * wide))
    lit = (-rows * np.float32(LIGHT[0]) - columns * np.float32(LIGHT[1])) * slope
    part = picture.y[top:bottom, left:right]
    part[:] = np.clip(part - np.float32(SHADING) * lit - np.float32(26.0 * min(1.0, depth / 12)) * dent, 20, 228)


def _warp(target: npt.NDArray[np.uint8], source: npt.NDArray[np.uint8], rows: Plane, columns: Plane) -> None:
    """Fill `target` with pixels from places in `source`, each interpolated between four pixels."""
    height, width = source.shape
    rows, columns = np.clip(rows, 0, height - 1.001), np.clip(columns, 0, width - 1.001)
    top, left = rows.astype(np.intp), columns.astype(np.intp)
    down, along = (rows - top).astype(np.float32), (columns - left).astype(np.float32)
    flat, first = source.ravel(), top * width + left
    upper = flat[first] + (flat[first + 1].astype(np.float32) - flat[first]) * along
    lower = flat[first + width] + (flat[first + width + 1].astype(np.float32) - flat[first + width]) * along
    target[:] = upper + (lower - upper) * down + 0.5
