"""The sensors besides the robot's state: ranges and a wrench, which a console draws, and the lock-out."""

import math
import threading
from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.navigation import PlanarPose
from lockstep.robot_bridge.robots.ros2.mapping.frame_listener import FrameListener
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide, header_ns
from lockstep.robot_bridge.robots.ros2.sensing.laser_scan import BadScan, Sectors
from lockstep.robot_bridge.robots.ros2.sensing.latest_message import Newest
from lockstep.robot_bridge.robots.ros2.settings import Lockout, Ranges, Wrench

__all__ = ["LockoutTopic", "RangeSensor", "WrenchTopic"]

MOUNT_TIMEOUT = 10.0  # s after which a transform that is not static is too old
FIRST_WORD = 3.0  # s for the first message of a lock-out, while the nodes find each other


class RangeSensor:
    """Reads ranges from sensor_msgs/LaserScan."""

    def __init__(self, ros: RosSide, settings: Ranges, frames: FrameListener | None = None) -> None:
        """`frames`: needed where the settings name the body's frame."""
        self._frames = frames
        self._frame = settings.frame
        self._sectors = Sectors(settings.count, settings.range_min, settings.range_max, settings.yaw)
        self._scans: Newest[list[float]] = Newest(settings.topic, settings.timeout)
        ros.subscribe(ros.interface("sensor_msgs/msg/LaserScan"), settings.topic, self._take)

    def values(self, now: float) -> list[float]:
        """Return the ranges; empty if they are too old."""
        arrived = self._scans.fresh(now)
        return [] if arrived is None else arrived.value

    def faults(self, now: float) -> list[str]:
        return self._scans.faults(now)

    def _take(self, message: Any) -> None:
        now = clock.now()
        try:
            self._scans.put(self._sectors.gather(message, self._mount(message, now)), now, header_ns(message.header))
        except BadScan as error:
            self._scans.refuse(str(error), now)

    def _mount(self, message: Any, now: float) -> PlanarPose | None:
        if self._frames is None or not self._frame:
            return None
        mount = self._frames.pose(self._frame, message.header.frame_id, now, MOUNT_TIMEOUT)
        if mount is None:
            raise BadScan("scan in a frame that is not connected with the body's")
        return mount


class WrenchTopic:
    """Reads a wrench from geometry_msgs/WrenchStamped."""

    def __init__(self, ros: RosSide, settings: Wrench) -> None:
        self._wrenches: Newest[list[float]] = Newest(settings.topic, settings.timeout)
        ros.subscribe(ros.interface("geometry_msgs/msg/WrenchStamped"), settings.topic, self._take)

    def values(self, now: float) -> list[float]:
        """Return the wrench; empty if it is too old."""
        arrived = self._wrenches.fresh(now)
        return [] if arrived is None else arrived.value

    def faults(self, now: float) -> list[str]:
        return self._wrenches.faults(now)

    def _take(self, message: Any) -> None:
        now = clock.now()
        force, torque = message.wrench.force, message.wrench.torque
        values = [force.x, force.y, force.z, torque.x, torque.y, torque.z]
        if all(map(math.isfinite, values)):
            self._wrenches.put(values, now, header_ns(message.header))
        else:
            self._wrenches.refuse("wrench with a value that is not a number", now)


class LockoutTopic:
    """Reads a lock-out from std_msgs/Bool, of a key switch or a teach pendant."""

    def __init__(self, ros: RosSide, settings: Lockout) -> None:
        self._topic = settings.topic
        self._is_hardware_stop = settings.hardware_stop
        self._said: Newest[bool] = Newest(settings.topic, settings.timeout)
        self._heard = threading.Event()
        ros.subscribe(ros.interface("std_msgs/msg/Bool"), settings.topic, self._take)

    def wait(self) -> None:
        """Block until the first message, at most for `FIRST_WORD`: a bridge that starts is not locked out early."""
        self._heard.wait(FIRST_WORD)

    def reason(self, now: float) -> str:
        """Return why the robot is locked; "" while it is not. A silent switch may have locked it."""
        said = self._said.fresh(now)
        if said is None:
            return f"no message of the lock-out topic arrives ({self._topic})"
        if not said.value:
            return ""
        # Of a hardware stop a person is told already that it is pressed.
        return f"by {self._topic}" if self._is_hardware_stop else f"locked at the robot ({self._topic})"

    def pressed(self, now: float) -> bool | None:
        """Return whether the hardware stop is pressed; None if this is none, or nothing says so now."""
        said = self._said.fresh(now) if self._is_hardware_stop else None
        return None if said is None else said.value

    def _take(self, message: Any) -> None:
        self._said.put(bool(message.data), clock.now())
        self._heard.set()
