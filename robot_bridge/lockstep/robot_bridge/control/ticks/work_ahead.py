"""What is computed between two ticks so that the next command and tick take less time."""

import time

from lockstep.robot_bridge.control.goals.measured_axes import MeasuredAxes
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["WorkAhead"]

SLOW = 0.1  # of a tick, from which on a measurement is slow
MOST_SLOW = 10  # slow measurements in a row, after which the robot is measured only when a command asks


class WorkAhead:
    """Lets the robot prepare, and measures the axes for the next command with goals.

    Attributes:
        seconds: that it took the last time
    """

    def __init__(self, robot: Robot, measured: MeasuredAxes) -> None:
        self.seconds = 0.0
        self._robot = robot
        self._measured = measured
        self._measures = robot.ticks_on_command  # for others a command waits for the next tick anyway
        self._slow = 0  # measurements in a row

    def do(self) -> None:
        """Do it now.

        Raises:
            BaseException: the adapter's.
        """
        began = time.perf_counter()
        self._robot.prepare()
        prepared = ended = time.perf_counter()
        if self._measures and self._slow < MOST_SLOW and self._measured.measure_ahead():
            ended = time.perf_counter()
            is_slow = ended - prepared >= SLOW * self._robot.tick_seconds
            self._slow = self._slow + 1 if is_slow else 0
        self.seconds = ended - began

    def leave_out(self) -> None:
        """There was no time for it. One call that took long must not keep it out for good."""
        self.seconds /= 2
