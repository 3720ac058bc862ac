"""A small complete robot without physics engine or GL: for tests, and for machines that have neither."""

from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot

__all__ = ["PlanarRobot", "create"]


def create() -> Robot:
    return PlanarRobot()
