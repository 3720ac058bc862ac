"""A micromanipulator: a probe needle in 32 nm steps over soft samples, under a microscope at 20x. Needs no graphics."""

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.micromanipulator.robot import Micromanipulator

__all__ = ["Micromanipulator", "create"]


def create() -> Robot:
    """Return the robot, with the needle above the slide and out of focus."""
    return Micromanipulator()
