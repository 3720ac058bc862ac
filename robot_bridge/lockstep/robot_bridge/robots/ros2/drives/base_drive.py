"""Drives a mobile base: publishes twists and reads odometry."""

import math
from typing import Any, NamedTuple

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.navigation import PlanarPose
from lockstep.robot_bridge.robots.ros2.drives.command_stream import Said
from lockstep.robot_bridge.robots.ros2.drives.drive import Drive, Sensed
from lockstep.robot_bridge.robots.ros2.drives.twists import TwistMaker
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide, header_ns
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.settings import Base

__all__ = ["BaseDrive", "BaseState", "base_state"]


class BaseState(NamedTuple):
    x: float  # m
    y: float
    yaw: float  # rad
    vx: float  # m/s, in the base's own frame
    vy: float
    wz: float  # rad/s


def base_state(odometry: Any) -> BaseState:
    """Return the state from nav_msgs/Odometry.

    Raises:
        ValueError: a number is missing or the orientation is not a quaternion.
    """
    position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    speed, spin = odometry.twist.twist.linear, odometry.twist.twist.angular
    length = turn.w * turn.w + turn.x * turn.x + turn.y * turn.y + turn.z * turn.z
    if not 0.5 < length < 2.0:
        raise ValueError("odometry without an orientation")
    yaw = math.atan2(
        2 * (turn.w * turn.z + turn.x * turn.y) / length, 1 - 2 * (turn.y * turn.y + turn.z * turn.z) / length
    )
    state = BaseState(position.x, position.y, yaw, speed.x, speed.y, spin.z)
    if not all(map(math.isfinite, state)):
        raise ValueError("odometry with a value that is not a number")
    return state


class BaseDrive(Drive):
    """A mobile base: axes forward, left and turn, as far as the base has them; joints x, y and yaw of the odometry."""

    def __init__(self, ros: RosSide, settings: Base, tick_seconds: float) -> None:
        command = settings.command
        self._has = (True, settings.left is not None, settings.turn is not None)
        self._twists = TwistMaker(ros, command)
        super().__init__(ros, self._twists.kind, command.topic, command.rate, sum(self._has), tick_seconds)
        self._still = settings.odometry.still
        self._odometry: Newest[BaseState] = Newest(settings.odometry.topic, settings.odometry.timeout)
        ros.subscribe(ros.interface("nav_msgs/msg/Odometry"), settings.odometry.topic, self._take)

    def seen(self, now: float) -> bool:
        return self._odometry.fresh(now) is not None

    def advance(self, said: Said, values: list[float], dt: float) -> Any:
        if said is Said.NOTHING:
            return None
        given = iter(values)
        return self._twists.make(*(next(given) if has else 0.0 for has in self._has))

    def sense(self, now: float) -> Sensed:
        arrived = self._odometry.fresh(now)
        if arrived is None:
            return Sensed([math.nan] * self.size, [math.nan] * 3, False)
        state = arrived.value
        axes = [value for value, has in zip(state[3:], self._has, strict=True) if has]
        return Sensed(axes, list(state[:3]), max(map(abs, state[3:])) <= self._still)

    def pose(self, now: float) -> PlanarPose | None:
        """Return the measured pose; None while it is not known. May be called from any thread."""
        arrived = self._odometry.fresh(now)
        return None if arrived is None else (arrived.value.x, arrived.value.y, arrived.value.yaw)

    def joints(self, now: float) -> list[float]:
        arrived = self._odometry.fresh(now)
        return [math.nan] * 3 if arrived is None else list(arrived.value[:3])

    def sensor_faults(self, now: float) -> list[str]:
        return self._odometry.faults(now)

    def _take(self, message: Any) -> None:
        now = clock.now()
        try:
            self._odometry.put(base_state(message), now, header_ns(message.header))
        except ValueError as error:
            self._odometry.refuse(str(error), now)
