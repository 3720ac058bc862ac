"""Turns LeRobot's pictures into those of the robot link. No I/O."""

from typing import Any, NamedTuple

import numpy as np

from lockstep.robot_bridge.robots.ros2.sensing.picture import BadPicture, from_image

__all__ = ["BadPicture", "to_yuv"]


class _Rgb(NamedTuple):
    height: int
    width: int
    encoding: str
    step: int
    data: memoryview


def to_yuv(picture: Any, width: int, height: int) -> bytes:
    """Return the planes Y, U and V of a picture: height x width x 3, uint8, RGB. An odd last row or column is left out.

    Raises:
        BadPicture: its shape or type is another one.
    """
    pixels = np.asarray(picture)
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 3:
        raise BadPicture("picture that is not height x width x 3 of uint8")
    if (pixels.shape[1] - width, pixels.shape[0] - height) not in ((0, 0), (0, 1), (1, 0), (1, 1)):
        raise BadPicture(f"picture of another size than {width}x{height}")
    rows = np.ascontiguousarray(pixels[:height, :width])
    return from_image(_Rgb(height, width, "rgb8", width * 3, rows.data.cast("B")), width, height).data
