"""Messages in Foxglove's schemas, as bytes. No I/O, no clock; times in ns since 1970."""

import math
from collections.abc import Iterator

import msgspec
from foxglove_schemas_protobuf.CompressedAudio_pb2 import CompressedAudio
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.format.records import FeedbackRecord, Vector, WrenchRecord
from lockstep.server.recording.format.robot_frames import (
    WORLD,
    fixed_transforms,
    moving_transforms,
    odometry,
    robot_shapes,
)
from lockstep.server.recording.format.topics import (
    FIXED_TRANSFORMS,
    JOINTS,
    ODOMETRY,
    OWN_TOPICS,
    POSE,
    SCAN,
    SHAPES,
    TRANSFORMS,
)
from lockstep.server.recording.writing.writer import Entry

__all__ = ["camera_message", "feedback_messages", "log_message", "robot_messages", "sound_message"]

SECOND = 1_000_000_000


def _stamp(time: int) -> Timestamp:
    return Timestamp(seconds=time // SECOND, nanos=time % SECOND)


def camera_message(stream: str, captured: int, picture: bytes, picture_format: str = "h264") -> bytes:
    """Wrap one H.264 access unit in Annex B, or one frame of "vp8"."""
    found = CompressedVideo(timestamp=_stamp(captured), frame_id=stream, data=picture, format=picture_format)
    return found.SerializeToString()


def sound_message(sound_format: str, captured: int, packet: bytes) -> bytes:
    """Wrap a packet of "opus", or of "g711-ulaw": 8 kHz, mono."""
    return CompressedAudio(timestamp=_stamp(captured), data=packet, format=sound_format).SerializeToString()


def log_message(arrived: int, text: str, *, warning: bool = False) -> bytes:
    level = Log.WARNING if warning else Log.INFO
    return Log(timestamp=_stamp(arrived), level=level, message=text, name="lockstep").SerializeToString()


def robot_messages(description: RobotDescription, event: int, arrived: int) -> Iterator[Entry]:
    """Yield what is fixed of a robot in Foxglove's schemas: frames of bodies without joints, and shapes."""
    if description.bodies:
        yield Entry(FIXED_TRANSFORMS, event, arrived, arrived, fixed_transforms(description, arrived))
        yield Entry(SHAPES, event, arrived, arrived, robot_shapes(description, arrived))


def feedback_messages(
    description: RobotDescription, feedback: FeedbackRecord, arrived: int, captured: int
) -> Iterator[Entry]:
    """Yield a feedback in Foxglove's schemas, for programs that do not know Lockstep's own records."""
    stamp = _stamp(captured)

    def entry(topic: str, data: bytes) -> Entry:
        return Entry(topic, feedback.event, arrived, captured, data)

    if description.joints and len(feedback.joints) == len(description.joints):
        states = [
            JointState(name=joint.name, position=position)
            for joint, position in zip(description.joints, feedback.joints, strict=True)
        ]
        yield entry(JOINTS, JointStates(timestamp=stamp, joints=states).SerializeToString())
    if description.ranges is not None and feedback.ranges:
        ring = description.ranges
        scan = LaserScan(
            timestamp=stamp,
            frame_id=ring.body,
            pose=_pose(0.0, 0.0, 0.0),
            start_angle=ring.angle_min,
            end_angle=ring.angle_min + ring.angle_increment * (len(feedback.ranges) - 1),
            ranges=feedback.ranges,
        )
        yield entry(SCAN, scan.SerializeToString())
    joints = dict(zip((joint.name for joint in description.joints), feedback.joints, strict=False))
    if description.bodies:
        yield entry(TRANSFORMS, moving_transforms(description, joints, captured))
    base = description.planar_base
    if base is not None and {base.x, base.y, base.yaw} <= joints.keys():
        pose = _pose(joints[base.x], joints[base.y], joints[base.yaw])
        yield entry(POSE, PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=pose).SerializeToString())
        yield entry(ODOMETRY, odometry(description, base, pose, feedback.axes, captured))
    if description.wrench is not None and len(feedback.wrench) == 6:
        wrench = WrenchRecord(
            epoch=feedback.epoch,
            event=feedback.event,
            frame_id=description.wrench.body,
            force=Vector(*feedback.wrench[:3]),
            torque=Vector(*feedback.wrench[3:]),
        )
        yield entry(OWN_TOPICS[WrenchRecord], msgspec.json.encode(wrench))


def _pose(x: float, y: float, yaw: float) -> Pose:
    turn = Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return Pose(position=Vector3(x=x, y=y, z=0.0), orientation=turn)
