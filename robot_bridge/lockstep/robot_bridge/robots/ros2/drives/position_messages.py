"""Makes the messages that tell an arm's controller the positions of its joints."""

from collections.abc import Sequence
from typing import Any

from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import ArmCommand

__all__ = ["PositionMessages"]


class PositionMessages:
    """The messages of one command topic."""

    def __init__(self, ros: RosSide, command: ArmCommand, names: Sequence[str], kind: Any) -> None:
        self._ros = ros
        self._names = list(names)
        self._horizon = command.horizon
        self._kind = kind
        makers = {"JointTrajectory": self._trajectory, "JointState": self._joint_state}
        self._make = makers.get(command.message, self._numbers)

    def make(self, points: list[float], velocities: list[float]) -> Any:
        """Return the message. `points`: rad or m, of each joint. `velocities`: of the same, for a JointState."""
        return self._make(points, velocities)

    def _trajectory(self, points: list[float], velocities: list[float]) -> Any:
        """Return a trajectory of positions alone: controllers refuse one that ends with a velocity."""
        message = self._kind()
        message.joint_names = self._names
        point = self._ros.interface("trajectory_msgs/msg/JointTrajectoryPoint")()
        point.positions = points
        point.time_from_start = self._ros.span_message(self._horizon)
        message.points = [point]
        return message

    def _joint_state(self, points: list[float], velocities: list[float]) -> Any:
        message = self._kind()
        message.header.stamp = self._ros.now_message()
        message.name = self._names
        message.position = points
        message.velocity = velocities
        return message

    def _numbers(self, points: list[float], velocities: list[float]) -> Any:
        message = self._kind()
        message.data = points
        return message
