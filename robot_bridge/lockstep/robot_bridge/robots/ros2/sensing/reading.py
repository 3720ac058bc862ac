"""Reads a topic with one value, for the robot's status: a mode, a temperature, a number, a switch or a text."""

import math
from typing import Any

from lockstep.protocol.actions import MAX_NUMBER, StatusItem, StatusLevel
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide, header_ns
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.sensing.words import words_of
from lockstep.robot_bridge.robots.ros2.settings import Reading, kind_of_reading

__all__ = ["ReadingTopic"]

UNITS = {"temperature": "°C"}

Value = bool | float | str


class ReadingTopic:
    """One reading: its newest value, its level by the limits of the settings, and its age."""

    def __init__(self, ros: RosSide, settings: Reading) -> None:
        self._settings = settings
        self._kind = kind_of_reading(settings)
        self._values: Newest[Value] = Newest(settings.topic, settings.timeout)
        package = "sensor_msgs" if settings.message == "Temperature" else "std_msgs"
        ros.subscribe(ros.interface(f"{package}/msg/{settings.message}"), settings.topic, self._take)

    def items(self, now: float) -> list[StatusItem]:
        """Return its item; none before the first message. An old reading has its age."""
        last = self._values.last()
        if last is None:
            return []
        settings = self._settings
        level, text = self._judged(last.value)
        return [
            StatusItem(
                name=settings.name,
                label=settings.label or settings.name,
                kind=self._kind,
                value=last.value,
                unit=settings.unit or UNITS.get(self._kind, ""),
                level=level,
                text=text,
                age=max(0.0, now - last.time),
                old_after=settings.timeout,
            )
        ]

    def _judged(self, value: Value) -> tuple[StatusLevel, str]:
        if isinstance(value, bool | str):
            return "ok", ""
        for level, bound in (("error", self._settings.error), ("warning", self._settings.warning)):
            if bound is not None and value > bound:
                return ("error" if level == "error" else "warning"), f"above {bound:g}"
        return "ok", ""

    def _take(self, message: Any) -> None:
        """Read std_msgs (data) or sensor_msgs/Temperature (temperature). A number that is none is left out."""
        now = clock.now()
        if self._settings.message == "Temperature":
            value: Value = float(message.temperature)
        elif self._settings.message == "String":
            value = words_of(message.data)
        elif self._settings.message == "Bool":
            value = bool(message.data)
        else:
            value = float(message.data)
        if isinstance(value, float) and not (math.isfinite(value) and abs(value) <= MAX_NUMBER):
            self._values.refuse("a value that is not a number", now)
            return
        self._values.put(value, now, header_ns(message.header) if self._settings.message == "Temperature" else 0)
