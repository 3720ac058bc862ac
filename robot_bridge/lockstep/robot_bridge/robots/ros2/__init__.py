"""Any robot that ROS 2 drives, described by one YAML file (docs/ros2.md). rclpy is imported when a robot is made."""

from pathlib import Path

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError, SettingsError
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.ros2.description import describe
from lockstep.robot_bridge.robots.ros2.settings import Ros2Settings
from lockstep.robot_bridge.robots.ros2.urdf_settings import with_urdf
from lockstep.robot_bridge.yaml_file import SettingsPlace, YamlFile

__all__ = ["create", "read_settings"]

MOST_BYTES = 4 << 20  # of a URDF


def create(path: Path) -> Robot:
    """Return the robot that the file describes.

    Raises:
        SettingsError: the file cannot be used; names the line and the key.
        RobotUnavailable: ROS 2 or something that it needs is missing.
    """
    settings, description = read_settings(path)
    from lockstep.robot_bridge.robots.ros2.robot import Ros2Robot

    return Ros2Robot(settings, description)


def read_settings(path: Path) -> tuple[Ros2Settings, RobotDescription]:
    """Read a robot's file, which needs no ROS.

    Raises:
        SettingsError: as for `create`.
    """
    file = YamlFile(path)
    settings = file.convert(Ros2Settings)
    try:
        if settings.urdf:
            settings = with_urdf(settings, _text(path.parent / settings.urdf))
        description = describe(settings)
        check_description(description)
    except SettingsPlace as place:
        raise file.error(place) from place
    except DescriptionError as error:
        raise SettingsError(f"{path}: {error.detail}") from error
    return settings, description


def _text(path: Path) -> str:
    """Return the text of a URDF file.

    Raises:
        SettingsPlace: the file cannot be read, or is too long.
    """
    try:
        with path.open("rb") as file:
            text = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise SettingsPlace(("urdf",), f"{path}: {error.strerror}") from error
    if len(text) > MOST_BYTES:
        raise SettingsPlace(("urdf",), f"{path}: longer than {MOST_BYTES} bytes")
    return text.decode(errors="replace")
