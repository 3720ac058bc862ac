"""Compares a camera's calibration with what sensor_msgs/CameraInfo says while the robot runs.

The description of a robot does not change while its bridge runs, so a calibration that no longer holds cannot be
replaced. It is said in the robot's status instead: what is drawn on the pictures is in the wrong place.
"""

from itertools import zip_longest
from typing import Any

from lockstep.protocol.actions import StatusItem
from lockstep.protocol.description import CameraCalibration
from lockstep.robot_bridge.robots.ros2.pinhole import Pinhole, is_rectified, pinhole_of
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import CameraTopic

__all__ = ["CameraInfoTopic", "difference"]

SHARE = 0.01  # of the focal length, and of the picture's width: as much as a person sees
COEFFICIENT = 0.02
MAX_LABEL = 200  # characters


def difference(calibration: CameraCalibration, pinhole: Pinhole, width: int, *, rectified: bool) -> str:
    """Return in words how CameraInfo differs from the calibration of pictures so wide; "": it does not."""
    undistorted = rectified and pinhole.rectified[0] > 0
    scale = width / pinhole.width
    said = [value * scale for value in (pinhole.rectified if undistorted else pinhole.raw)]
    known = (calibration.fx, calibration.fy, calibration.cx, calibration.cy)
    bounds = (SHARE * calibration.fx, SHARE * calibration.fy, SHARE * width, SHARE * width)
    for name, one, other, most in zip(("fx", "fy", "cx", "cy"), said, known, bounds, strict=True):
        if abs(one - other) > most:
            return f"{name} is {one:.4g}, the calibration says {other:.4g}"
    coefficients = () if undistorted else pinhole.distortion
    for one, other in zip_longest(coefficients, calibration.distortion, fillvalue=0.0):
        if abs(one - other) > COEFFICIENT:
            return f"a coefficient of the distortion is {one:.4g}, the calibration says {other:.4g}"
    return ""


class CameraInfoTopic:
    """What one camera's CameraInfo says, beside its calibration."""

    def __init__(self, ros: RosSide, camera: CameraTopic, calibration: CameraCalibration, topic: str) -> None:
        self._camera = camera
        self._calibration = calibration
        self._topic = topic
        self._rectified = is_rectified(camera.topic)
        self._difference = ""  # by the newest message that could be used; written by the node's thread
        ros.subscribe(ros.interface("sensor_msgs/msg/CameraInfo"), topic, self._take)

    def items(self) -> list[StatusItem]:
        """Return an item while it differs."""
        words, camera = self._difference, self._camera
        if not words:
            return []
        return [
            StatusItem(
                name=f"calibration_{camera.name}",
                label=f"Calibration of {camera.label or camera.name}"[:MAX_LABEL],
                value="differs",
                level="warning",
                text=f"{self._topic}: {words}. What is drawn on the pictures is in the wrong place",
            )
        ]

    def _take(self, message: Any) -> None:
        pinhole = pinhole_of(message)
        if pinhole is not None:
            self._difference = difference(self._calibration, pinhole, self._camera.width, rectified=self._rectified)
