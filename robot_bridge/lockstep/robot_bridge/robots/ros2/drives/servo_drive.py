"""Drives the tool of an arm by twists, as MoveIt Servo takes them, and reads joint states."""

import math
from typing import Any

from lockstep.robot_bridge.robots.ros2.description import SERVO_AXES
from lockstep.robot_bridge.robots.ros2.drives.command_stream import Said
from lockstep.robot_bridge.robots.ros2.drives.drive import Drive, Sensed
from lockstep.robot_bridge.robots.ros2.drives.joint_feedback import JointFeedback
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.servo_status import ServoStatusTopic
from lockstep.robot_bridge.robots.ros2.settings import Servo, ServoCommand

__all__ = ["ServoDrive", "tool_twist"]


def tool_twist(ros: RosSide, kind: Any, command: ServoCommand, values: list[float]) -> Any:
    """Return geometry_msgs/TwistStamped with values in the order of `SERVO_AXES`, m/s and rad/s."""
    message = kind()
    message.header.stamp = ros.now_message()
    message.header.frame_id = command.frame
    linear, angular = message.twist.linear, message.twist.angular
    linear.x, linear.y, linear.z, angular.z, angular.x, angular.y = values
    return message


class ServoDrive(Drive):
    """A tool with three axes along and three about x, y and z of the command's frame.

    No topic says how fast the tool moves, so the measured axes are unknown. Whether the arm is at rest, its joints say.
    """

    def __init__(self, ros: RosSide, settings: Servo, tick_seconds: float) -> None:
        command = settings.command
        kind = ros.interface("geometry_msgs/msg/TwistStamped")
        super().__init__(ros, kind, command.topic, command.rate, len(SERVO_AXES), tick_seconds)
        self._command = command
        self._feedback = JointFeedback(ros, settings.states, settings.joints)
        self._status = None if settings.status is None else ServoStatusTopic(ros, settings.status)

    def seen(self, now: float) -> bool:
        return self._feedback.is_complete(now)

    def advance(self, said: Said, values: list[float], dt: float) -> Any:
        return None if said is Said.NOTHING else tool_twist(self._ros, self.topic.kind, self._command, values)

    def sense(self, now: float) -> Sensed:
        known = self._feedback.known(now)
        positions = [joint.position for joint in known]
        return Sensed([math.nan] * self.size, positions, self._feedback.is_still(known))

    def joints(self, now: float) -> list[float]:
        return [joint.position for joint in self._feedback.known(now)]

    def sensor_faults(self, now: float) -> list[str]:
        return self._feedback.faults(now) + ([] if self._status is None else self._status.faults(now))
