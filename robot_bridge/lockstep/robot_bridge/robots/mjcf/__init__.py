"""A robot out of a MuJoCo model of the user's own, driven by its actuators, with its sensors and cameras."""

from pathlib import Path

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics, graphics_unavailable

__all__ = ["create"]

choose_graphics()  # before anything imports mujoco, which reads the choice once, at its own import


def create(path: Path) -> Robot:
    """The robot of the model in that file, with its renderer running.

    Raises:
        ModelError: the file is no model that can be driven; it says why.
        RobotUnavailable: OpenGL cannot be used here, so that the robot would have no cameras.
    """
    try:
        from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
    except (ImportError, RuntimeError, AttributeError, OSError) as error:  # mujoco loads its GL library at import
        raise graphics_unavailable(error) from error
    return MjcfRobot(path)
