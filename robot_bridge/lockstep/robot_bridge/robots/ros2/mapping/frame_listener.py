"""Listens to the transforms between frames: tf2_msgs/TFMessage on /tf and /tf_static."""

from typing import Any

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.navigation import PlanarPose
from lockstep.robot_bridge.robots.ros2.mapping.transforms import TransformTree
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide

__all__ = ["FrameListener"]

DEPTH = 100  # messages: every node of the robot publishes on these topics


class FrameListener:
    """The node's thread writes the transforms; poses are looked up from any thread."""

    def __init__(self, ros: RosSide) -> None:
        """Subscribe.

        Raises:
            RobotUnavailable: tf2_msgs is not installed.
        """
        self._tree = TransformTree()
        kind = ros.interface("tf2_msgs/msg/TFMessage")
        ros.subscribe(kind, "/tf", self._take, depth=DEPTH)
        ros.subscribe(kind, "/tf_static", self._take_static, depth=DEPTH, kept=True)

    def pose(self, frame: str, child: str, now: float, timeout: float) -> PlanarPose | None:
        """As `TransformTree.pose`."""
        return self._tree.pose(frame, child, now, timeout)

    def _take(self, message: Any) -> None:
        self._tree.take(message, clock.now(), static=False)

    def _take_static(self, message: Any) -> None:
        self._tree.take(message, clock.now(), static=True)
