"""What is computed between two ticks so that the next command and tick take less time."""

import time

from lockstep.robot_bridge.control.goals.measured_axes import MeasuredAxes
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["WorkAhead"]

DEAR = 0.05  # of a tick: what takes longer to measure is measured only when a command asks


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

    def do(self) -> None:
        """Do it now.

        Raises:
            BaseException: the adapter's.
        """
        began = time.perf_counter()
        self._robot.prepare()
        prepared = ended = time.perf_counter()
        if self._measures and self._measured.measure_ahead():
            ended = time.perf_counter()
            self._measures = ended - prepared < DEAR * self._robot.tick_seconds
        self.seconds = ended - began
