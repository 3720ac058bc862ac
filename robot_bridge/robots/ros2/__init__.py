"""Any robot that ROS 2 drives, described by one YAML file (docs/ros2.md). rclpy is imported when one is made."""

from pathlib import Path

from robot_bridge.check_description import check_description
from robot_bridge.errors import DescriptionError, SettingsError
from robot_bridge.protocol.description import RobotDescription
from robot_bridge.robots.base import Robot
from robot_bridge.robots.ros2.description import describe
from robot_bridge.robots.ros2.settings import Ros2Settings
from robot_bridge.yaml_file import SettingsPlace, YamlFile

__all__ = ["create", "read_settings"]


def create(path: Path) -> Robot:
    """The robot that the file describes.

    Raises:
        SettingsError: the file cannot be used; names the line and the key.
        RobotUnavailable: ROS 2 or something that it needs is missing.
    """
    settings, description = read_settings(path)
    from robot_bridge.robots.ros2.robot import Ros2Robot

    return Ros2Robot(settings, description)


def read_settings(path: Path) -> tuple[Ros2Settings, RobotDescription]:
    """Needs no ROS. Raises SettingsError as `create` does."""
    file = YamlFile(path)
    settings = file.convert(Ros2Settings)
    try:
        description = describe(settings)
        check_description(description)
    except SettingsPlace as place:
        raise file.error(place) from place
    except DescriptionError as error:
        raise SettingsError(f"{path}: {error.detail}") from error
    return settings, description
