"""Makes the command messages of a base."""

from typing import Any

from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import TwistCommand

__all__ = ["TwistMaker"]


class TwistMaker:
    """Makes Twist or TwistStamped, as the base takes it.

    Attributes:
        kind: the message's class
    """

    def __init__(self, ros: RosSide, command: TwistCommand) -> None:
        self.kind = ros.interface(f"geometry_msgs/msg/{command.message}")
        self._ros = ros
        self._stamped = command.message == "TwistStamped"
        self._frame = command.frame

    def make(self, vx: float, vy: float, wz: float) -> Any:
        """Return a message with these velocities, m/s and rad/s, in the base's own frame."""
        message = self.kind()
        twist = message
        if self._stamped:
            message.header.stamp = self._ros.now_message()
            message.header.frame_id = self._frame
            twist = message.twist
        twist.linear.x, twist.linear.y, twist.angular.z = vx, vy, wz
        return message
