"""Makes robots by name. Each is imported only when needed: a robot's packages are not needed for the others."""

from importlib import import_module

from lockstep.robot_bridge.errors import UnknownRobot
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.own_robot import create_own_robot, installed_robots

__all__ = ["create_robot", "is_robot", "robot_names", "simulated_names"]

_PACKAGES = {
    "mobile-manipulator": "lockstep.robot_bridge.robots.mobile_manipulator",
    "mobile-manipulator-goals": "lockstep.robot_bridge.robots.mobile_manipulator.goal_driven",
    "micromanipulator": "lockstep.robot_bridge.robots.micromanipulator",
    "planar": "lockstep.robot_bridge.robots.planar",
    "so101": "lockstep.robot_bridge.robots.so101",
}


def simulated_names() -> list[str]:
    """Return the names of the robots that come with this package."""
    return sorted(_PACKAGES)


def robot_names() -> list[str]:
    """Return the names of the robots of this package and of the entry points of installed packages."""
    return sorted({*_PACKAGES, *installed_robots()})


def is_robot(name: str) -> bool:
    """Return whether `create_robot` would try to make a robot of that name. Imports nothing of the robot."""
    return name in _PACKAGES or ":" in name or name in installed_robots()


def create_robot(name: str) -> Robot:
    """Make a robot. `name`: one of `robot_names`, or "module:Class".

    Raises:
        UnknownRobot: no robot has that name.
        BadRobot: a robot from outside this package cannot be made.
        DescriptionError: the robot's description contradicts itself.
        RobotUnavailable: a package that it needs is missing on this machine.
    """
    if name not in _PACKAGES:
        spec = name if ":" in name else installed_robots().get(name)
        if spec is None:
            known = ", ".join(robot_names())
            raise UnknownRobot(f"no robot {name!r}; choose one of {known}, or give module:Class for your own robot")
        return create_own_robot(spec)
    robot = import_module(_PACKAGES[name]).create()
    if not isinstance(robot, Robot):
        raise TypeError(f"{_PACKAGES[name]}.create() must return a Robot")
    return robot
