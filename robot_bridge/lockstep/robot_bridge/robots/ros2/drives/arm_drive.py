"""Drives an arm: publishes joint positions, ahead of the arm by a short horizon, or velocities; reads joint states."""

from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.drives.command_stream import Said
from lockstep.robot_bridge.robots.ros2.drives.drive import Drive, Sensed
from lockstep.robot_bridge.robots.ros2.drives.joint_feedback import JointFeedback
from lockstep.robot_bridge.robots.ros2.drives.setpoints import Setpoints
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Arm

__all__ = ["PACKAGES", "ArmDrive", "velocities_message"]

PACKAGES = {"JointTrajectory": "trajectory_msgs", "JointState": "sensor_msgs", "Float64MultiArray": "std_msgs"}


def velocities_message(kind: Any, values: list[float]) -> Any:
    """Return std_msgs/Float64MultiArray as the velocity controllers of ros2_control take it."""
    message = kind()
    message.data = values
    return message


class ArmDrive(Drive):
    """An arm with one axis per joint, the joint's velocity.

    The last message of a motion is the setpoint itself, not ahead by the horizon: the arm stays there. A controller of
    velocities gets zeros.
    """

    def __init__(self, ros: RosSide, settings: Arm, tick_seconds: float) -> None:
        command = settings.command
        kind = ros.message(PACKAGES[command.message], command.message)
        super().__init__(ros, kind, command.topic, command.rate, len(settings.joints), tick_seconds)
        self._names = [joint.name for joint in settings.joints]
        self._horizon = command.horizon
        self._setpoints = Setpoints([joint.maximum * command.lead for joint in settings.joints])
        self._moving = False
        self._feedback = JointFeedback(ros, settings.states, self._names)
        makers = {"JointTrajectory": self._trajectory, "JointState": self._joint_state}
        self._make = makers.get(command.message, self._velocities)

    def seen(self, now: float) -> bool:
        return self._feedback.is_complete(now)

    def advance(self, said: Said, values: list[float], dt: float) -> Any:
        now = clock.now()
        moving = any(values)
        if moving:
            measured = self.joints(now)
            if not self._moving:
                self._setpoints.begin(measured)
            self._setpoints.advance(values, measured, dt)
        self._moving = moving
        if said is Said.NOTHING:
            return None
        return self._make(said, values)

    def sense(self, now: float) -> Sensed:
        known = self._feedback.known(now)
        velocities = [joint.velocity for joint in known]
        return Sensed(velocities, [joint.position for joint in known], self._feedback.is_still(known))

    def joints(self, now: float) -> list[float]:
        return [joint.position for joint in self._feedback.known(now)]

    def sensor_faults(self, now: float) -> list[str]:
        return self._feedback.faults(now)

    def _trajectory(self, said: Said, values: list[float]) -> Any:
        """Return a trajectory of positions alone: controllers refuse one that ends with a velocity."""
        message = self._kind()
        message.joint_names = self._names
        point = self._ros.message("trajectory_msgs", "JointTrajectoryPoint")()
        point.positions = self._points(said, values)
        point.time_from_start = self._ros.span_message(self._horizon)
        message.points = [point]
        return message

    def _joint_state(self, said: Said, values: list[float]) -> Any:
        message = self._kind()
        message.header.stamp = self._ros.now_message()
        message.name = self._names
        message.position = self._points(said, values)
        message.velocity = values
        return message

    def _velocities(self, said: Said, values: list[float]) -> Any:
        return velocities_message(self._kind, values)

    def _points(self, said: Said, values: list[float]) -> list[float]:
        return self._setpoints.points if said is Said.ZERO else self._setpoints.ahead(values, self._horizon)
