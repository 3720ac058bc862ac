"""Drives an arm: publishes joint positions, ahead of the arm by a short horizon, or velocities; reads joint states."""

from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.ros2.drives.command_stream import Said
from lockstep.robot_bridge.robots.ros2.drives.drive import Drive, Sensed
from lockstep.robot_bridge.robots.ros2.drives.joint_feedback import JointFeedback
from lockstep.robot_bridge.robots.ros2.drives.position_messages import PositionMessages
from lockstep.robot_bridge.robots.ros2.drives.setpoints import Setpoints
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import Arm, ArmCommand

__all__ = ["PACKAGES", "ArmDrive", "takes_velocities", "velocities_message"]

PACKAGES = {"JointTrajectory": "trajectory_msgs", "JointState": "sensor_msgs", "Float64MultiArray": "std_msgs"}


def takes_velocities(command: ArmCommand) -> bool:
    """Return whether the controller takes velocities, and so goes on until it gets zeros."""
    return command.message == "Float64MultiArray" and command.interface == "velocity"


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
        kind = ros.interface(f"{PACKAGES[command.message]}/msg/{command.message}")
        super().__init__(ros, kind, command.topic, command.rate, len(settings.joints), tick_seconds)
        self._names = [joint.name for joint in settings.joints]
        self._horizon = command.horizon
        self._setpoints = Setpoints([joint.maximum * command.lead for joint in settings.joints])
        self._moving = False
        self._feedback = JointFeedback(ros, settings.states, self._names)
        self._messages = PositionMessages(ros, command, self._names, kind)
        self._takes_velocities = takes_velocities(command)

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
        if self._takes_velocities:
            return velocities_message(self.topic.kind, values)
        return self._messages.make(self._points(said, values), values)

    def sense(self, now: float) -> Sensed:
        known = self._feedback.known(now)
        velocities = [joint.velocity for joint in known]
        return Sensed(velocities, [joint.position for joint in known], self._feedback.is_still(known))

    def joints(self, now: float) -> list[float]:
        return [joint.position for joint in self._feedback.known(now)]

    def sensor_faults(self, now: float) -> list[str]:
        return self._feedback.faults(now)

    def _points(self, said: Said, values: list[float]) -> list[float]:
        return self._setpoints.points if said is Said.ZERO else self._setpoints.ahead(values, self._horizon)
