"""Counts the messages of one topic and keeps what they say of the robot. No I/O, no clock."""

import math
from dataclasses import replace
from typing import Any

from lockstep.robot_bridge.robots.ros2.discovery.graph import Heard
from lockstep.robot_bridge.robots.ros2.pinhole import pinhole_of
from lockstep.robot_bridge.robots.ros2.sensing.jpeg_size import jpeg_size

__all__ = ["TopicMessages"]

MAX_TEXT = 100
MAX_JOINTS = 64
CLOCKS_APART = 10.0  # s; a header's stamp that is older was given by another clock, or means nothing


class TopicMessages:
    """`take` each message; then `heard` says what they had in common. The newest message has the last word."""

    def __init__(self) -> None:
        self._heard = Heard(stamped=True)
        self._first = self._last = 0.0
        self._joints: dict[str, None] = {}  # in the order of their first message

    def take(self, message: Any, now: float, age: float | None) -> None:
        """Take in a message.

        `now`: s. `age`: s since its header's stamp by the ROS clock; None without a stamp.
        """
        self._last = now
        if self._heard.count == 0:
            self._first = now
        stamped = self._heard.stamped and age is not None and 0 <= age <= CLOCKS_APART
        self._heard = replace(self._heard, count=self._heard.count + 1, stamped=stamped, **self._said(message))

    def heard(self) -> Heard:
        span, gaps = self._last - self._first, self._heard.count - 1
        if self._heard.count == 0:
            return Heard()
        return replace(self._heard, rate=gaps / span if gaps > 0 and span > 0 else None)

    def _said(self, message: Any) -> dict[str, Any]:
        """Read by the fields that a message has, whatever it is called."""
        said: dict[str, Any] = {}
        if (header := getattr(message, "header", None)) is not None:
            said["frame"] = str(header.frame_id)[:MAX_TEXT]
        if (child := getattr(message, "child_frame_id", None)) is not None:
            said["child_frame"] = str(child)[:MAX_TEXT]
        if hasattr(message, "position") and hasattr(message, "name"):
            for name in list(message.name)[:MAX_JOINTS]:
                if len(self._joints) < MAX_JOINTS and 0 < len(name) <= MAX_TEXT:
                    self._joints.setdefault(str(name))
            said["joints"] = tuple(self._joints)
        if hasattr(message, "range_max") and math.isfinite(message.range_min) and math.isfinite(message.range_max):
            said["range_min"], said["range_max"] = float(message.range_min), float(message.range_max)
        if (found := pinhole_of(message)) is not None:
            said["pinhole"] = found
        if hasattr(message, "encoding"):
            said["width"], said["height"] = int(message.width), int(message.height)
            said["encoding"] = str(message.encoding)[:MAX_TEXT]
        elif hasattr(message, "format"):
            said["width"], said["height"] = jpeg_size(bytes(message.data)) or (0, 0)
            said["encoding"] = str(message.format)[:MAX_TEXT]
        return said
