"""Converts red, green and blue into planes Y, U, V of a 4:2:0 picture, BT.601 limited range."""

import numpy as np
import numpy.typing as npt

__all__ = ["Picture", "picture_of"]

Plane = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]


class Picture:
    """Planes of one 4:2:0 picture of even width and height, in one buffer."""

    def __init__(self, width: int, height: int, buffer: Bytes | None = None) -> None:
        luma, quarter = width * height, width * height // 4
        self.buffer = np.empty(luma + 2 * quarter, np.uint8) if buffer is None else buffer
        self.y = self.buffer[:luma].reshape(height, width)
        self.u = self.buffer[luma : luma + quarter].reshape(height // 2, width // 2)
        self.v = self.buffer[luma + quarter :].reshape(height // 2, width // 2)

    def copy(self) -> "Picture":
        height, width = self.y.shape
        return Picture(width, height, self.buffer.copy())


def picture_of(red: Plane, green: Plane, blue: Plane) -> Picture:
    """Return a picture of values from 0 to 1; values beyond are clipped."""
    height, width = red.shape
    picture = Picture(width, height)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    picture.y[:] = 16.5 + 219.0 * np.clip(luma, 0.0, 1.0)
    small_luma, small_red, small_blue = _halved(luma), _halved(red), _halved(blue)
    picture.u[:] = np.clip(128.5 + 126.4 * (small_blue - small_luma), 16, 240)
    picture.v[:] = np.clip(128.5 + 159.7 * (small_red - small_luma), 16, 240)
    return picture


def _halved(plane: Plane) -> Plane:
    height, width = plane.shape
    halved: Plane = plane.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3), dtype=np.float32)
    return halved
