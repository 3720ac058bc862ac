"""The calibration of a model's camera, from its field of view and its place. No rendering."""

import math
from collections.abc import Iterable
from typing import Any, Final

import msgspec
import mujoco

from lockstep.protocol.description import Body, Camera, CameraCalibration

__all__ = ["calibrated"]

FIXED: Final = int(mujoco.mjtCamLight.mjCAMLIGHT_FIXED)
DIGITS: Final = 6


def calibrated(camera: Camera, model: Any, bodies: Iterable[Body]) -> Camera:
    """Return the camera, which has its name in the model, with its calibration.

    It comes back as it is where no pinhole that is fixed to one of the described `bodies`, or to the world, tells its
    view.
    """
    number = model.camera(camera.name).id
    carrier = int(model.cam_bodyid[number])
    body = model.body(carrier).name if carrier else ""
    follows = int(model.cam_mode[number]) != FIXED  # it turns towards something: no fixed place
    has_sensor = float(model.cam_sensorsize[number][1]) > 0  # then the field of view is not what counts
    is_described = carrier == 0 or body in {each.name for each in bodies}
    if follows or has_sensor or int(model.cam_projection[number]) or not is_described:
        return camera
    focal = camera.height / 2 / math.tan(math.radians(float(model.cam_fovy[number])) / 2)
    w, x, y, z = (float(value) for value in model.cam_quat[number])
    optical = (-x, w, z, -y)  # turned by half a turn about x: MuJoCo's camera looks along -z, y up
    return msgspec.structs.replace(
        camera,
        calibration=CameraCalibration(
            fx=round(focal, DIGITS),
            fy=round(focal, DIGITS),
            cx=camera.width / 2,
            cy=camera.height / 2,
            body=body,
            position=_rounded(model.cam_pos[number]),
            orientation=_rounded(optical),
        ),
    )


def _rounded(values: Any) -> Any:
    return tuple(round(float(value), DIGITS) + 0.0 for value in values)
