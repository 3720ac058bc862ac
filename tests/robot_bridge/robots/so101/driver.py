"""Drives the arm in simulated time through the bridge's own shaping of goals and its limits."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.motion_limits import MotionLimits
from lockstep.robot_bridge.robots.so101.robot import So101

__all__ = ["MODEL_FOLDER", "ArmDriver"]

MODEL_FOLDER: Final = Path(__file__).parents[4] / ".so101"  # `make test` fetches it
EVENT_SECONDS: Final = 0.04


class ArmDriver:
    """One command an event, an event each 40 ms.

    Attributes:
        reached: each commanded goal was within the axes' reach, as the bridge asks
    """

    def __init__(self, robot: So101) -> None:
        self.robot = robot
        self.description = robot.describe()
        self.names = [axis.name for axis in self.description.axes]
        self._shaper = AxisShaper(
            self.description.axes,
            hold=self.description.hold,
            limiter=MotionLimits(self.description, robot, robot.tick_seconds),
            poses=self.description.poses,
            pursued=robot.goals,
        )
        self._shaper.begin(robot.measured_axes(), robot.goals())
        self._now = 0.0
        self._event = 1
        self.reached = True

    @property
    def feedback(self) -> Feedback:
        measured = self.robot.measure()
        return Feedback(
            event=self._event,
            issue=1,
            time=self._now,
            axes=measured.axes,
            joints=measured.joints,
            goals=self._shaper.goals,
            wrench=measured.wrench,
            at_rest=measured.at_rest,
            faults=measured.faults,
        )

    def command(self, values: Mapping[str, float | None] | list[float | None], speed: float = 1.0) -> Feedback:
        """Let one event pass; the axes that are not named stay."""
        if isinstance(values, Mapping):
            values = [values.get(name) for name in self.names]
        places = self.robot.measured_axes()
        for axis, value, place in zip(self.description.axes, values, places, strict=True):
            self.reached = self.reached and (value is None or abs(value - place) <= axis.reach)
        self._shaper.drive(values, self._now, speed)
        self._event += 1
        self.ticks(EVENT_SECONDS)
        return self.feedback

    def drive(self, seconds: float, **goals: float) -> Feedback:
        """Repeat a command (tool_x=0.2) for so long; without any, nothing follows."""
        named = {name.replace("tool_", "tool."): value for name, value in goals.items()}
        for _ in range(round(seconds / EVENT_SECONDS)):
            if named:
                self.command(named)
            else:
                self.ticks(EVENT_SECONDS)
        return self.feedback

    def ticks(self, seconds: float) -> None:
        for _ in range(round(seconds / self.robot.tick_seconds)):
            if self._shaper.may_take_up and (goals := self.robot.take_up()) is not None:
                self._shaper.take_up(goals)
            values = self._shaper.step(self._now, self.robot.tick_seconds)
            self.robot.pursue_poses(self._shaper.pursued_poses)
            self.robot.apply(values)
            self.robot.tick()
            self._now += self.robot.tick_seconds

    def reset(self) -> None:
        """What the bridge does when a stop is released."""
        self.robot.reset()
        self._shaper.begin(self.robot.measured_axes(), self.robot.goals())

    def value(self, name: str) -> float:
        """A measured value."""
        return self.robot.measured_axes()[self.names.index(name)]
