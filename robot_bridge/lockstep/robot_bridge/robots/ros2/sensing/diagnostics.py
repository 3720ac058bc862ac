"""Reads diagnostic_msgs/DiagnosticArray, for the robot's status: what each component says of itself."""

import threading
from collections import OrderedDict
from typing import Any, Final, NamedTuple

from lockstep.protocol.actions import StatusItem, StatusLevel
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.words import words_of
from lockstep.robot_bridge.robots.ros2.settings import Diagnostics

__all__ = ["Components", "DiagnosticsTopic"]

KEPT = 256  # components; nodes may name new ones without end
PUBLISHERS = 32  # that may speak at once
FORGOTTEN: Final = 120.0  # s after a component's last word
NAME = 150  # characters
WORST: Final[dict[StatusLevel, int]] = {"error": 0, "warning": 1, "ok": 2}


class _Component(NamedTuple):
    level: StatusLevel
    text: str
    time: float


class Components:
    """The newest word of each component. No I/O, no clock."""

    def __init__(self, most: int, old_after: float) -> None:
        """`most`: shown at once; `old_after`: s."""
        self._most = most
        self._old_after = old_after
        self._known: OrderedDict[str, _Component] = OrderedDict()  # the longest silent first

    def take(self, name: str, level: int, message: str, now: float) -> None:
        """Take one status. `level`: 0 OK, 1 WARN, 2 ERROR, 3 STALE; another one counts as an error."""
        key = words_of(name, NAME) or "unnamed"
        told: StatusLevel = "ok" if level == 0 else "warning" if level in (1, 3) else "error"
        text = words_of(message) or ("stale" if level == 3 else "")
        self._known[key] = _Component(told, text, now)
        self._known.move_to_end(key)
        if len(self._known) > KEPT:
            self._known.popitem(last=False)

    def items(self, now: float) -> list[StatusItem]:
        """Return the items, the worst first, then by name; the last one counts those that are not shown."""
        while self._known and now - next(iter(self._known.values())).time > FORGOTTEN:
            self._known.popitem(last=False)
        ordered = sorted(self._known.items(), key=lambda each: (WORST[each[1].level], each[0]))
        shown = [self._item(name, component, now) for name, component in ordered[: self._most]]
        hidden = len(ordered) - len(shown)
        if hidden:
            value = f"{hidden} more, none worse than these"
            shown.append(StatusItem(name="diagnostics", label="Diagnostics", kind="text", value=value))
        return shown

    def _item(self, name: str, component: _Component, now: float) -> StatusItem:
        level, text, time = component
        return StatusItem(
            name=f"diagnostics/{name}",
            label=name,
            kind="text",
            value=text or level,
            level=level,
            text="" if level == "ok" else text or level,
            age=max(0.0, now - time),
            old_after=self._old_after,
        )


class DiagnosticsTopic:
    """The components of all nodes that publish on one topic."""

    def __init__(self, ros: RosSide, settings: Diagnostics) -> None:
        self._components = Components(settings.most, settings.timeout)
        self._lock = threading.Lock()  # the node's thread takes, the bridge's loop reads
        ros.subscribe(
            ros.interface("diagnostic_msgs/msg/DiagnosticArray"), settings.topic, self._take, depth=PUBLISHERS
        )

    def items(self, now: float) -> list[StatusItem]:
        with self._lock:
            return self._components.items(now)

    def _take(self, message: Any) -> None:
        now = clock.now()
        with self._lock:
            for status in message.status[:KEPT]:
                self._components.take(status.name, _number(status.level), status.message, now)


def _number(level: Any) -> int:
    """Return the level, which rclpy gives as one byte."""
    return level[0] if isinstance(level, bytes) and level else int(level or 0)
