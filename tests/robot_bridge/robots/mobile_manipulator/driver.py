"""Drives the robot in simulated time, as the bridge would."""

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.base import Measurement
from lockstep.robot_bridge.robots.mobile_manipulator.robot import MobileManipulator

__all__ = ["Driver"]


class Driver:
    def __init__(self, robot: MobileManipulator) -> None:
        self.robot = robot
        self.data = robot.simulation.data
        self.names = [axis.name for axis in robot.describe().axes]

    def run(self, seconds: float, **axes: float) -> Measurement:
        """Hold these axes (base_vx=0.5) for so long and measure; without any, the robot rests."""
        values = [0.0] * len(self.names)
        for name, value in axes.items():
            values[self.names.index(name.replace("_", "."))] = value
        for _ in range(round(seconds / self.robot.tick_seconds)):
            self.robot.apply(values)
            self.robot.tick()
        return self.robot.measure()

    def tool(self) -> npt.NDArray[np.float64]:
        """The tool tip against the arm's mount, in the base frame."""
        mount = self.data.body("mount")
        offset = self.data.site("tool_tip").xpos - mount.xpos
        return mount.xmat.reshape(3, 3).T @ offset  # type: ignore[no-any-return]

    def place(self, name: str) -> npt.NDArray[np.float64]:
        return self.data.body(name).xpos.copy()  # type: ignore[no-any-return]
