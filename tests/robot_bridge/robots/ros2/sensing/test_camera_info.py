"""A calibration beside CameraInfo, without ROS: messages that any driver may have made."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lockstep.protocol.description import CameraCalibration
from lockstep.robot_bridge.robots.ros2.pinhole import pinhole_of
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.camera_info import CameraInfoTopic, difference
from lockstep.robot_bridge.robots.ros2.settings import CameraTopic

CALIBRATION = CameraCalibration(fx=250.0, fy=255.0, cx=160.0, cy=120.0, distortion_model="plumb_bob", distortion=(0.1,))
CAMERA = CameraTopic(name="front", topic="/front/image", width=320, height=240, calibration=CALIBRATION)


def info(fx: float = 500.0, cx: float = 320.0, d: tuple[float, ...] = (0.1, 0.0), **parts: Any) -> SimpleNamespace:
    """Of a sensor of 640 x 480; the rectified picture has another pinhole."""
    fields = {
        **{"width": 640, "height": 480, "distortion_model": "plumb_bob", "binning_x": 0, "binning_y": 0},
        **{"header": SimpleNamespace(frame_id="front"), "roi": SimpleNamespace(width=0, x_offset=0), "d": list(d)},
        "k": [fx, 0.0, cx, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0],
        "p": [480.0, 0.0, 310.0, 0.0, 0.0, 480.0, 235.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
    return SimpleNamespace(**{**fields, **parts})


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (info(), ""),
        (info(fx=503.0, cx=322.0), ""),
        (info(fx=520.0), "fx is 260, the calibration says 250"),
        (info(cx=340.0), "cx is 170, the calibration says 160"),
        (info(d=()), "a coefficient of the distortion is 0, the calibration says 0.1"),
    ],
)
def test_a_calibration_differs_by_what_a_person_would_see(message: SimpleNamespace, words: str) -> None:
    pinhole = pinhole_of(message)
    assert pinhole is not None
    assert difference(CALIBRATION, pinhole, 320, rectified=False) == words


def test_rectified_pictures_are_compared_with_the_projection() -> None:
    pinhole = pinhole_of(info())
    assert pinhole is not None
    rectified = CameraCalibration(fx=240.0, fy=240.0, cx=155.0, cy=117.5)
    assert difference(rectified, pinhole, 320, rectified=True) == ""
    assert difference(rectified, pinhole, 320, rectified=False) != ""


class Ros:
    """Takes one subscription."""

    def __init__(self) -> None:
        self.take: Callable[[Any], None] = lambda message: None
        self.topic = ""

    def interface(self, name: str) -> str:
        return name

    def subscribe(self, kind: str, topic: str, callback: Callable[[Any], None]) -> None:
        assert kind == "sensor_msgs/msg/CameraInfo"
        self.topic, self.take = topic, callback


def test_the_status_says_a_difference_for_as_long_as_it_lasts() -> None:
    ros = Ros()
    topic = CameraInfoTopic(cast(RosSide, ros), CAMERA, CALIBRATION, "/front/camera_info")
    assert ros.topic == "/front/camera_info"
    assert topic.items() == []
    ros.take(info(fx=520.0))
    (item,) = topic.items()
    assert (item.name, item.label, item.level) == ("calibration_front", "Calibration of front", "warning")
    assert item.text.startswith("/front/camera_info: fx is 260")
    ros.take(info(k=[0.0] * 9))  # a driver without a calibration says nothing against it
    assert topic.items() == [item]
    ros.take(info())
    assert topic.items() == []
