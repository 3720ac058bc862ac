"""Describes the model's cameras as streams, or a free camera if it has none."""

from collections.abc import Collection
from typing import Any, Final

import msgspec

from lockstep.protocol.description import Camera
from lockstep.robot_bridge.robots.mjcf.names import label_of, name_of
from lockstep.robot_bridge.robots.mujoco_view.camera_view import camera_view
from lockstep.robot_bridge.robots.mujoco_view.canvas import FREE_CAMERA

__all__ = ["cameras_of"]

MOST: Final = 4
MAIN: Final = (640, 480, 30.0)
OTHERS: Final = (320, 240, 15.0)
SMALLEST, LARGEST = 64, 1280  # pixels


def cameras_of(model: Any, bodies: Collection[str]) -> dict[Camera, int]:
    """Return each camera with its number in the model, the main one first. `bodies`: the described ones."""
    if model.ncam == 0:
        width, height, rate = MAIN
        return {Camera(name="free", label="Overview", width=width, height=height, frame_rate=rate): FREE_CAMERA}
    return {_camera(model, number, bodies): number for number in range(min(model.ncam, MOST))}


def _camera(model: Any, number: int, bodies: Collection[str]) -> Camera:
    width, height, rate = MAIN if number == 0 else OTHERS
    wide, high = (int(pixels) for pixels in model.cam_resolution[number])
    if min(wide, high) > 1:  # the model has a resolution
        width, height = _fitting(wide), _fitting(high)
    name = name_of(model, "camera", number)
    camera = Camera(name=name, label=label_of(name), width=width, height=height, frame_rate=rate)
    owner = int(model.cam_bodyid[number])
    body = name_of(model, "body", owner) if owner else ""
    if body and body not in bodies:
        return camera
    return msgspec.structs.replace(camera, view=camera_view(model, number, camera, body))


def _fitting(pixels: int) -> int:
    return min(max(pixels, SMALLEST), LARGEST) // 2 * 2
