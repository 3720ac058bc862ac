"""The mobile manipulator with an arm that is driven by goals: of its joints, and of its tool's pose."""

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics, graphics_unavailable

__all__ = ["create"]

choose_graphics()  # before anything imports mujoco, which reads the choice once, at its own import


def create() -> Robot:
    """Return the robot, with its renderer running.

    Raises:
        RobotUnavailable: OpenGL cannot be used here, so the robot would have no cameras.
    """
    try:
        from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator
    except (ImportError, RuntimeError, AttributeError, OSError) as error:  # mujoco loads its GL library at import
        raise graphics_unavailable(error) from error
    return MobileManipulator(goals=True)
