"""The pinhole model of a camera, as sensor_msgs/CameraInfo says it, and which of its two pictures a topic carries."""

import math
from typing import Any, NamedTuple

__all__ = ["Pinhole", "is_rectified", "pinhole_of"]

MAX_TEXT = 100
MAX_DISTORTION = 14  # coefficients


class Pinhole(NamedTuple):
    """What a sensor_msgs/CameraInfo says: of the raw picture, and of the rectified one."""

    width: int
    height: int
    frame: str
    raw: tuple[float, float, float, float]  # fx, fy, cx, cy, pixels
    rectified: tuple[float, float, float, float]
    distortion_model: str
    distortion: tuple[float, ...]


def is_rectified(topic: str) -> bool:
    """Return whether the pictures of a topic are rectified, by the names of image_proc: "/camera/image_rect"."""
    parts = [part for part in topic.removesuffix("/compressed").split("/") if part]
    return bool(parts) and "rect" in parts[-1]


def pinhole_of(message: Any) -> Pinhole | None:
    """Return what a CameraInfo says; None for another message, without calibration, or for a part of the sensor."""
    if not all(hasattr(message, name) for name in ("k", "p", "d", "binning_x", "roi")):
        return None
    if max(message.binning_x, message.binning_y) > 1 or message.roi.width or message.roi.x_offset:
        return None
    k, p = [float(value) for value in message.k], [float(value) for value in message.p]
    distortion = tuple(float(value) for value in message.d[: MAX_DISTORTION + 1])
    numbers = (*k, *p, *distortion)
    if not all(math.isfinite(value) and abs(value) < 1e6 for value in numbers) or len(distortion) > MAX_DISTORTION:
        return None
    if not (k[0] > 0 and k[4] > 0 and message.width > 0 and message.height > 0):
        return None
    return Pinhole(
        int(message.width),
        int(message.height),
        str(message.header.frame_id)[:MAX_TEXT],
        (k[0], k[4], k[2], k[5]),
        (p[0], p[5], p[2], p[6]),
        str(message.distortion_model)[:MAX_TEXT] if any(distortion) else "",
        distortion if any(distortion) else (),
    )
