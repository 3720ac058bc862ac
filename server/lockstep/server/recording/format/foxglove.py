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
from lockstep.server.recording.format.topics import JOINTS, OWN_TOPICS, POSE, SCAN
from lockstep.server.recording.writing.writer import Entry

__all__ = ["WORLD", "camera_message", "feedback_messages", "log_message", "sound_message"]

WORLD = "world"  # frame of the base's pose
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
    pose = _base_pose(description, feedback.joints)
    if pose is not None:
        yield entry(POSE, PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=pose).SerializeToString())
    if description.wrench is not None and len(feedback.wrench) == 6:
        wrench = WrenchRecord(
            epoch=feedback.epoch,
            event=feedback.event,
            frame_id=description.wrench.body,
            force=Vector(*feedback.wrench[:3]),
            torque=Vector(*feedback.wrench[3:]),
        )
        yield entry(OWN_TOPICS[WrenchRecord], msgspec.json.encode(wrench))


def _base_pose(description: RobotDescription, joints: list[float]) -> Pose | None:
    base = description.planar_base
    positions = dict(zip((joint.name for joint in description.joints), joints, strict=False))
    if base is None or not {base.x, base.y, base.yaw} <= positions.keys():
        return None
    return _pose(positions[base.x], positions[base.y], positions[base.yaw])


def _pose(x: float, y: float, yaw: float) -> Pose:
    turn = Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return Pose(position=Vector3(x=x, y=y, z=0.0), orientation=turn)
