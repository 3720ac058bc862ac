"""The parts that messages of ROS 2 consist of: stamps, headers, vectors and poses. Times in ns since 1970."""

import math
from collections.abc import Sequence
from typing import Any, Final

from rosbags.typesys.store import Typestore

__all__ = ["MessageParts", "about_z"]

SECOND: Final = 1_000_000_000


class MessageParts:
    """Makes objects of the type store. An orientation is a quaternion, w first."""

    def __init__(self, store: Typestore) -> None:
        self._types = store.types

    def make(self, name: str, /, **fields: Any) -> Any:
        """Return a message; `name` is its package and type, like `std_msgs/Header`."""
        package, _, kind = name.partition("/")
        return self._types[f"{package}/msg/{kind}"](**fields)

    def stamp(self, time: int) -> Any:
        return self.make("builtin_interfaces/Time", sec=time // SECOND, nanosec=time % SECOND)

    def header(self, time: int, frame: str) -> Any:
        return self.make("std_msgs/Header", stamp=self.stamp(time), frame_id=frame)

    def vector(self, vector: Sequence[float]) -> Any:
        x, y, z = vector
        return self.make("geometry_msgs/Vector3", x=float(x), y=float(y), z=float(z))

    def quaternion(self, orientation: Sequence[float]) -> Any:
        w, x, y, z = orientation
        return self.make("geometry_msgs/Quaternion", x=float(x), y=float(y), z=float(z), w=float(w))

    def planar_pose(self, x: float, y: float, yaw: float) -> Any:
        return self.make(
            "geometry_msgs/Pose",
            position=self.make("geometry_msgs/Point", x=x, y=y, z=0.0),
            orientation=self.quaternion(about_z(yaw)),
        )

    def transform(
        self, time: int, parent: str, child: str, position: Sequence[float], orientation: Sequence[float]
    ) -> Any:
        """Return the pose of frame `child` in frame `parent`."""
        return self.make(
            "geometry_msgs/TransformStamped",
            header=self.header(time, parent),
            child_frame_id=child,
            transform=self.make(
                "geometry_msgs/Transform",
                translation=self.vector(position),
                rotation=self.quaternion(orientation),
            ),
        )


def about_z(yaw: float) -> tuple[float, float, float, float]:
    """Return the quaternion of a turn about z; `yaw` in rad."""
    return math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
