"""Lets goals at rest follow a robot that something else moves."""

from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["TakenUpGoals"]


class TakenUpGoals:
    """Asks the robot in ticks that begin at rest. Call `look` once a tick, before the axes are driven."""

    def __init__(self, robot: Robot, shaper: AxisShaper) -> None:
        self._robot = robot
        self._shaper = shaper
        self._moved = False  # something else moved the goals at the last look

    def look(self) -> bool:
        """Take up the robot's own goals; return whether a motion by something else has ended, to be fed back at once.

        Raises:
            BaseException: the adapter raised.
        """
        if not self._shaper.may_take_up:
            return False
        before, pursued = self._moved, self._robot.take_up()
        self._moved = pursued is not None and self._shaper.take_up(pursued)
        return before and not self._moved
