"""Reads what MoveIt Servo says of itself: moveit_msgs/ServoStatus, or std_msgs/Int8 before ROS 2 Jazzy."""

from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.settings import ServoStatus

__all__ = ["ServoStatusTopic"]

MAX_STATUS = 200  # characters


class ServoStatusTopic:
    """Servo's own word on why it slows down or halts: shown, and never a reason to move."""

    def __init__(self, ros: RosSide, settings: ServoStatus) -> None:
        package = "moveit_msgs" if settings.message == "ServoStatus" else "std_msgs"
        self._said: Newest[str] = Newest(settings.topic, settings.timeout)
        ros.subscribe(ros.interface(f"{package}/msg/{settings.message}"), settings.topic, self._take)

    def faults(self, now: float) -> list[str]:
        said = self._said.fresh(now)
        return self._said.faults(now) + (
            [f"{self._said.topic}: {said.value}"] if said is not None and said.value else []
        )

    def _take(self, message: Any) -> None:
        """Read ServoStatus (code, message) or Int8 (data), whose numbers differ from release to release; 0 is well."""
        code = int(getattr(message, "code", getattr(message, "data", 0)))
        text = " ".join(str(getattr(message, "message", "")).split())
        words = "".join(filter(str.isprintable, text))[:MAX_STATUS]
        self._said.put("" if code == 0 else words or f"MoveIt Servo reports status {code}", clock.now())
