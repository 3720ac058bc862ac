"""Robots by name. Each is imported only when asked for: a robot's packages are not needed for the others."""

from importlib import import_module

from robot_bridge.errors import UnknownRobot
from robot_bridge.robots.base import Robot

__all__ = ["create_robot", "robot_names"]

_PACKAGES = {
    "mobile-manipulator": "robot_bridge.robots.mobile_manipulator",
    "micromanipulator": "robot_bridge.robots.micromanipulator",
    "planar": "robot_bridge.robots.planar",
}


def robot_names() -> list[str]:
    return sorted(_PACKAGES)


def create_robot(name: str) -> Robot:
    """A new robot.

    Raises:
        UnknownRobot: no robot has that name. RobotUnavailable: a package that it needs is missing on this machine.
    """
    if name not in _PACKAGES:
        raise UnknownRobot(f"no robot {name!r}; there are {', '.join(robot_names())}")
    robot = import_module(_PACKAGES[name]).create()
    if not isinstance(robot, Robot):
        raise TypeError(f"{_PACKAGES[name]}.create() must return a Robot")
    return robot
