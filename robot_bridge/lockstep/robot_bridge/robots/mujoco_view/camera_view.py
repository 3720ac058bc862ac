"""Describes where a camera of a MuJoCo model is, and its projection."""

import math
from typing import Any, Final

import mujoco

from lockstep.protocol.description import Camera, CameraView

__all__ = ["camera_view"]

FIXED: Final = int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
DIGITS: Final = 6


def camera_view(model: Any, number: int, camera: Camera, body: str) -> CameraView | None:
    """Return the view of a camera of the model; None for one that follows something, or has intrinsics of its own.

    `body`: the described name of the body that it is fixed to.
    """
    if number < 0 or int(model.cam_mode[number]) != FIXED or any(model.cam_sensorsize[number]):
        return None
    high = float(model.cam_fovy[number])
    if not 0.0 < high < 180.0:
        return None
    focal = camera.height / 2 / math.tan(math.radians(high) / 2)
    # MuJoCo's camera has x to the right, y up and looks along -z: half a turn about x away.
    w, x, y, z = (float(part) for part in model.cam_quat[number])
    px, py, pz = (round(float(part), DIGITS) for part in model.cam_pos[number])
    return CameraView(
        body=body,
        position=(px, py, pz),
        orientation=(round(-x, DIGITS), round(w, DIGITS), round(z, DIGITS), round(-y, DIGITS)),
        fx=round(focal, 3),
        fy=round(focal, 3),
        cx=camera.width / 2,
        cy=camera.height / 2,
    )
