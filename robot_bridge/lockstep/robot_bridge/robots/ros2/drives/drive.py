"""The common base of the parts of a ROS 2 robot that take commands."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.drives.command_stream import CommandStream, Said
from lockstep.robot_bridge.robots.ros2.drives.command_topic import CommandTopic
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide

__all__ = ["Drive", "Sensed"]


class Sensed(NamedTuple):
    """State of one part; NaN for values that are not known."""

    axes: list[float]
    joints: list[float]
    at_rest: bool


class Drive(ABC):
    """One command topic, and the topic that reports the state that the commands lead to.

    Attributes:
        size: number of axes
        topic: the command topic
    """

    def __init__(self, ros: RosSide, kind: Any, topic: str, rate: float, size: int, tick_seconds: float) -> None:
        self.size = size
        self.topic = CommandTopic(ros, kind, topic)
        self._ros = ros
        self._name = topic
        self._stream = CommandStream(rate, [0.0] * size, tick_seconds)
        self._stopped = False

    def step(self, values: Sequence[float], dt: float) -> None:
        """Run one tick with these values."""
        now = clock.now()
        lost = self.lost(now)
        step = self._stream.step(values, lost, now)
        self.topic.publish(self.advance(step.said, step.values, dt), step.said)

    def lost(self, now: float) -> bool:
        """Look whether a node listens; return whether the part must not move."""
        is_heard = self.topic.look(now)
        return self._stopped or not (is_heard and self.seen(now))

    def goals(self, now: float) -> list[float]:
        """Return the goal that each axis pursues; NaN for one that has none."""
        return [math.nan] * self.size

    def measured_axes(self, now: float) -> list[float]:
        """Return the measured value of each axis now; cheaper than `sense` where that matters."""
        return self.sense(now).axes

    def end(self) -> None:
        """Publish zero if the last message was another, because the bridge closes."""
        self._stream.end()
        if self.topic.owes_zero:
            self.topic.publish(self.advance(Said.ZERO, [0.0] * self.size, 0.0), Said.ZERO)

    def rest_from_thread(self) -> None:
        """Publish zero if the last message was another; the bridge's own tick may hang anywhere in `step`."""
        if self.topic.owes_zero:
            self.topic.publish_from_thread(self.advance(Said.ZERO, [0.0] * self.size, 0.0))

    def stop(self) -> None:
        """Publish zero if the last message was another, and no moving values until `reset`."""
        self._stopped = True
        self.end()

    def reset(self) -> None:
        self._stopped = False

    def faults(self, now: float) -> list[str]:
        """Return the faults that keep this part from being driven, in words for a person."""
        found = self.sensor_faults(now) + self.topic.faults()
        if self._stream.withheld and not self._stopped and not found:
            found.append(f"{self._name}: let go of the controls once; the robot was not reached while they were held")
        return found

    @abstractmethod
    def seen(self, now: float) -> bool:
        """Return whether the state is known well enough to move."""

    @abstractmethod
    def advance(self, said: Said, values: list[float], dt: float) -> Any:
        """Return the message to publish; None for nothing. Called in every tick."""

    @abstractmethod
    def sense(self, now: float) -> Sensed:
        """Return the state now."""

    @abstractmethod
    def joints(self, now: float) -> list[float]:
        """Return the positions of the joints now, for limits; cheap."""

    @abstractmethod
    def sensor_faults(self, now: float) -> list[str]:
        """Return the faults of the state's topic."""
