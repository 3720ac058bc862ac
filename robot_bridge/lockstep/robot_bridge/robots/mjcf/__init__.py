"""Robots from the user's MuJoCo models, driven by their actuators, with their sensors and cameras."""

from pathlib import Path

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics, graphics_unavailable

__all__ = ["create"]

choose_graphics()  # before anything imports mujoco, which reads the choice once, at its own import


def create(path: Path) -> Robot:
    """Return the robot of the model in `path`, with its renderer running.

    Raises:
        ModelError: the file is not a model that can be driven; the text says why.
        RobotUnavailable: OpenGL cannot be used here, so the robot would have no cameras.
    """
    try:
        from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
    except (ImportError, RuntimeError, AttributeError, OSError) as error:  # mujoco loads its GL library at import
        raise graphics_unavailable(error) from error
    return MjcfRobot(path)
