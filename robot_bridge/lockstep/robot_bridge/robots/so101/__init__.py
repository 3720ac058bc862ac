"""The SO-101 arm in MuJoCo: five joints and a gripper on a table with blocks and a bowl, driven by goals."""

import os

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics, graphics_unavailable
from lockstep.robot_bridge.robots.so101.model_source import arm_file

__all__ = ["create"]

choose_graphics()  # before anything imports mujoco, which reads the choice once, at its own import


def create() -> Robot:
    """Return the robot, with its renderer running.

    Raises:
        ModelMissing: the arm's model was not fetched.
        ModelError: the fetched files are not that model.
        RobotUnavailable: OpenGL cannot be used here, so the robot would have no cameras.
    """
    path = arm_file(os.environ)
    try:
        from lockstep.robot_bridge.robots.so101.robot import So101
    except (ImportError, RuntimeError, AttributeError, OSError) as error:  # mujoco loads its GL library at import
        raise graphics_unavailable(error) from error
    return So101(path)
