"""Messages of ROS 2 of a session. Times in ns since 1970; the stamps in headers are times of capture."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from lockstep.protocol.description import Body, Camera, PlanarBase, RangeRing, RobotDescription, WrenchSensor
from lockstep.protocol.description import CameraCalibration as Calibration
from lockstep.protocol.maps import OccupancyMap, PlanarPose, map_cells
from lockstep.server.recording.export.rosbag2.message_parts import MessageParts, about_z
from lockstep.server.recording.format.map_messages import MAP_FRAME, in_world
from lockstep.server.recording.format.records import FeedbackRecord
from lockstep.server.recording.format.robot_frames import WORLD, base_body, camera_frames
from lockstep.server.scene.kinematics import body_pose

__all__ = ["COMPRESSED_VIDEO", "RosMessages", "ros_types"]

COMPRESSED_VIDEO: Final = "foxglove_msgs/msg/CompressedVideo"
# foxglove_msgs/msg/CompressedVideo: ROS' own messages have none for a stream whose pictures need those before them.
VIDEO_DEFINITION: Final = "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n"


def ros_types() -> Typestore:
    """Return the messages of the oldest ROS 2 that has all fields used here, so that newer ones read them too."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(VIDEO_DEFINITION, COMPRESSED_VIDEO))
    return store


class RosMessages:
    """Makes messages, as objects of the type store."""

    def __init__(self, store: Typestore) -> None:
        self._parts = MessageParts(store)

    def text(self, text: str) -> Any:
        return self._parts.make("std_msgs/String", data=text)

    def video(self, camera: str, time: int, picture: bytes, picture_format: str) -> Any:
        return self._parts.make(
            "foxglove_msgs/CompressedVideo",
            timestamp=self._parts.stamp(time),
            frame_id=camera,
            data=np.frombuffer(picture, dtype=np.uint8),
            format=picture_format,
        )

    def camera_info(self, camera: Camera, found: Calibration, time: int, size: tuple[int, int]) -> Any:
        """Return the CameraInfo for pictures of `size`, which may be smaller than the camera's: all of it is seen."""
        wide, high = size[0] / camera.width, size[1] / camera.height
        fx, fy, cx, cy = found.fx * wide, found.fy * high, found.cx * wide, found.cy * high
        none = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        return self._parts.make(
            "sensor_msgs/CameraInfo",
            header=self._parts.header(time, camera.name),
            width=size[0],
            height=size[1],
            distortion_model=found.distortion_model or "plumb_bob",
            d=np.array(found.distortion or (0.0,) * 5, dtype=np.float64),
            k=np.array((fx, 0, cx, 0, fy, cy, 0, 0, 1), dtype=np.float64),
            r=np.eye(3, dtype=np.float64).reshape(-1),
            p=np.array((fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0), dtype=np.float64),
            binning_x=0,
            binning_y=0,
            roi=self._parts.make("sensor_msgs/RegionOfInterest", **none),
        )

    def joints(self, names: list[str], positions: Sequence[float], time: int) -> Any:
        return self._parts.make(
            "sensor_msgs/JointState",
            header=self._parts.header(time, ""),
            name=names,
            position=np.array(positions, dtype=np.float64),
            velocity=np.zeros(0),
            effort=np.zeros(0),
        )

    def scan(self, ring: RangeRing, ranges: Sequence[float], time: int) -> Any:
        return self._parts.make(
            "sensor_msgs/LaserScan",
            header=self._parts.header(time, ring.body or WORLD),
            angle_min=ring.angle_min,
            angle_max=ring.angle_min + ring.angle_increment * (len(ranges) - 1),
            angle_increment=ring.angle_increment,
            time_increment=0.0,
            scan_time=0.0,
            range_min=ring.range_min,
            range_max=ring.range_max,
            ranges=np.array(ranges, dtype=np.float32),
            intensities=np.zeros(0, dtype=np.float32),
        )

    def wrench(self, sensor: WrenchSensor, values: Sequence[float], time: int) -> Any:
        wrench = self._parts.make(
            "geometry_msgs/Wrench", force=self._parts.vector(values[:3]), torque=self._parts.vector(values[3:])
        )
        return self._parts.make(
            "geometry_msgs/WrenchStamped", header=self._parts.header(time, sensor.body or WORLD), wrench=wrench
        )

    def grid(self, map: OccupancyMap, time: int) -> Any:
        """Return the map as a nav_msgs/OccupancyGrid, in MAP_FRAME. Raises MessageError: its cells make no sense."""
        x, y, yaw = map.origin
        info = self._parts.make(
            "nav_msgs/MapMetaData",
            map_load_time=self._parts.stamp(time),
            resolution=map.resolution,
            width=map.width,
            height=map.height,
            origin=self._parts.planar_pose(x, y, yaw),
        )
        cells = np.frombuffer(map_cells(map), np.int8)  # 255, not known, is -1 there
        return self._parts.make(
            "nav_msgs/OccupancyGrid", header=self._parts.header(time, MAP_FRAME), info=info, data=cells
        )

    def map_frame(self, frame: PlanarPose, time: int) -> Any:
        """Return where MAP_FRAME is in WORLD. `frame`: the pose of the other in the one."""
        x, y, yaw = in_world(frame)
        stamped = self._parts.transform(time, WORLD, MAP_FRAME, (x, y, 0.0), about_z(yaw))
        return self._parts.make("tf2_msgs/TFMessage", transforms=[stamped])

    def odometry(
        self,
        description: RobotDescription,
        base: PlanarBase,
        feedback: FeedbackRecord,
        joints: Mapping[str, float],
        time: int,
    ) -> Any:
        """Return the pose of the base in WORLD, and its measured twist in its own frame; covariances are zero."""
        axes = dict(zip((axis.name for axis in description.axes), feedback.axes, strict=False))
        yaw = joints[base.yaw]
        pose = self._parts.planar_pose(joints[base.x], joints[base.y], yaw)
        twist = self._parts.make(
            "geometry_msgs/Twist",
            linear=self._parts.vector((axes.get(base.forward, 0.0), axes.get(base.left, 0.0), 0.0)),
            angular=self._parts.vector((0.0, 0.0, axes.get(base.turn, 0.0))),
        )
        unknown = np.zeros(36)
        return self._parts.make(
            "nav_msgs/Odometry",
            header=self._parts.header(time, WORLD),
            child_frame_id=base_body(description, base),
            pose=self._parts.make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=unknown),
            twist=self._parts.make("geometry_msgs/TwistWithCovariance", twist=twist, covariance=unknown),
        )

    def moving_transforms(self, description: RobotDescription, joints: Mapping[str, float], time: int) -> Any:
        return self._transforms((body for body in description.bodies if body.joints), joints, time)

    def fixed_transforms(self, description: RobotDescription, time: int) -> Any:
        fixed = [body for body in description.bodies if not body.joints]
        return self._transforms([*fixed, *camera_frames(description)], {}, time)

    def _transforms(self, bodies: Iterable[Body], joints: Mapping[str, float], time: int) -> Any:
        found = []
        for body in bodies:
            parent = body.parent or WORLD
            if body.name == parent:
                continue  # a frame in itself
            pose = body_pose(body, joints)
            found.append(self._parts.transform(time, parent, body.name, pose.position, pose.orientation))
        return self._parts.make("tf2_msgs/TFMessage", transforms=found)
