"""A topic to which commands are published."""

from typing import Any

from lockstep.robot_bridge.robots.ros2.drives.command_stream import Said
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide

__all__ = ["CommandTopic"]

LOOK_INTERVAL = 0.2  # s between looks for subscribers


class CommandTopic:
    """The publisher of a drive's commands, and whether a node listens to it.

    Attributes:
        kind: the class of its messages
        owes_zero: the last published message was not zero
        is_heard: a node listened at the last look
    """

    def __init__(self, ros: RosSide, kind: Any, name: str) -> None:
        self.kind = kind
        self.owes_zero = False
        self.is_heard = False
        self._name = name
        self._publisher = ros.publisher(kind, name)
        self._looked = float("-inf")  # s, time of that look

    @property
    def full_name(self) -> str:
        """The name with namespace and node resolved."""
        return str(self._publisher.topic_name)

    def look(self, now: float) -> bool:
        """Look at intervals whether a node listens; return whether one does."""
        if now - self._looked >= LOOK_INTERVAL:
            self.is_heard, self._looked = self._publisher.get_subscription_count() > 0, now
        return self.is_heard

    def publish(self, message: Any, said: Said) -> None:
        """Publish what the message says; None for nothing."""
        if message is not None:
            self.owes_zero = True  # also when publishing raises
            self._publisher.publish(message)
            self.owes_zero = said is not Said.ZERO

    def publish_from_thread(self, zero: Any) -> None:
        """Publish a zero beside the thread of the ticks, which owes its own as before."""
        self._publisher.publish(zero)

    def faults(self) -> list[str]:
        return [] if self.is_heard else [f"{self._name}: no subscriber for {self.kind.__name__}"]
