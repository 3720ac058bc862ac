"""The topics of a recording, with their schemas. No I/O."""

import json
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import msgspec
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedAudio_pb2 import CompressedAudio
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.format.own_messages import AxisCommands, AxisStates, WrenchStamped
from lockstep.server.recording.format.records import (
    OWN_RECORDS,
    ActionRecord,
    CommandRecord,
    Degraded,
    EpisodeRecord,
    FeedbackRecord,
    MapRecord,
    NavigationRecord,
    NoteRecord,
    OwnRecord,
    ParticipantsRecord,
    RefusalRecord,
    ReportRecord,
    RestRecord,
    RobotRecord,
    SeatRecord,
    ShadowRecord,
    SignatureRecord,
    StatusRecord,
    StopRecord,
    TraceRecord,
    WrenchRecord,
)

__all__ = [
    "AXIS_COMMANDS",
    "AXIS_STATES",
    "CALIBRATION",
    "CAMERA",
    "FIXED_TRANSFORMS",
    "JOINTS",
    "LOG",
    "MAP",
    "MICROPHONE",
    "ODOMETRY",
    "OWN_TOPICS",
    "PICTURE_FORMATS",
    "POSE",
    "SCAN",
    "SHAPES",
    "SIGNATURE",
    "SOUND_FORMATS",
    "TRANSFORMS",
    "WRENCH",
    "Topic",
    "has_frames",
    "media_topic",
    "own_schema",
    "stream_of",
    "topics_of",
]

CAMERA, MICROPHONE = "/camera/", "/microphone/"  # and the stream's name
JOINTS, SCAN, POSE, LOG = "/joint_states", "/scan", "/pose", "/log"
AXIS_COMMANDS, AXIS_STATES, WRENCH = "/axis_commands", "/axis_states", "/wrench"
CALIBRATION = "/camera_calibration/"  # and the camera's name
MAP = "/map"
TRANSFORMS, FIXED_TRANSFORMS, ODOMETRY, SHAPES = "/tf", "/tf_static", "/odom", "/robot_shapes"

# The names of formats in messages, by codec. One topic can have several.
PICTURE_FORMATS = {"H264": "h264", "VP8": "vp8"}  # in CompressedVideo
SOUND_FORMATS = {"opus": "opus", "PCMU": "g711-ulaw"}  # in CompressedAudio

OWN_TOPICS: dict[type[OwnRecord], str] = {
    RobotRecord: "/lockstep/robot",
    CommandRecord: "/lockstep/command",
    FeedbackRecord: "/lockstep/feedback",
    RefusalRecord: "/lockstep/refusal",
    RestRecord: "/lockstep/rest",
    SeatRecord: "/lockstep/seat",
    ShadowRecord: "/lockstep/shadow",
    StopRecord: "/lockstep/stop",
    ActionRecord: "/lockstep/action",
    StatusRecord: "/lockstep/status",
    MapRecord: "/lockstep/map",
    NavigationRecord: "/lockstep/navigation",
    ParticipantsRecord: "/lockstep/participants",
    ReportRecord: "/lockstep/report",
    TraceRecord: "/lockstep/trace",
    NoteRecord: "/lockstep/note",
    EpisodeRecord: "/lockstep/episode",
    Degraded: "/lockstep/degraded",
    WrenchRecord: WRENCH,  # in earlier files
    SignatureRecord: "/lockstep/signature",
}
SIGNATURE = OWN_TOPICS[SignatureRecord]


class Topic(NamedTuple):
    name: str  # "/camera/front"
    schema: str  # "foxglove.CompressedVideo"
    schema_encoding: str  # "protobuf" or "jsonschema"
    schema_data: bytes
    encoding: str  # of the messages: "protobuf" or "json"


def topics_of(description: RobotDescription, codecs: Mapping[str, str], *, signed: bool = False) -> list[Topic]:
    """Return all topics that a recording of this robot can have; `codecs`: "H264", "opus" or "PCMU" by stream."""
    found = [_own(topic, kind) for kind, topic in OWN_TOPICS.items() if kind not in (WrenchRecord, SignatureRecord)]
    if signed:
        found.append(_own(SIGNATURE, SignatureRecord))
    if description.wrench is not None:
        found.append(_protobuf(WRENCH, WrenchStamped))
    found += [_protobuf(AXIS_COMMANDS, AxisCommands), _protobuf(AXIS_STATES, AxisStates)]
    for stream, codec in codecs.items():
        found.append(
            _protobuf(media_topic(stream, codec), CompressedVideo if codec in PICTURE_FORMATS else CompressedAudio)
        )
    if description.joints:
        found.append(_protobuf(JOINTS, JointStates))
    if description.ranges is not None:
        found.append(_protobuf(SCAN, LaserScan))
    if description.planar_base is not None:
        found.append(_protobuf(POSE, PoseInFrame))
        found.append(_protobuf(ODOMETRY, Odometry))
    if has_frames(description) or description.map is not None:
        found.append(_protobuf(TRANSFORMS, FrameTransforms))
    if has_frames(description):
        found.append(_protobuf(FIXED_TRANSFORMS, FrameTransforms))
    if description.map is not None:
        found.append(_protobuf(MAP, Grid))
    if description.bodies:
        found.append(_protobuf(SHAPES, SceneUpdate))
    for camera in description.cameras:
        if camera.calibration is not None:
            found.append(_protobuf(CALIBRATION + camera.name, CameraCalibration))
    found.append(_protobuf(LOG, Log))
    return found


def has_frames(description: RobotDescription) -> bool:
    """Return whether there is any frame but the world's."""
    return bool(description.bodies) or any(camera.calibration is not None for camera in description.cameras)


def media_topic(stream: str, codec: str) -> str:
    return (CAMERA if codec in PICTURE_FORMATS else MICROPHONE) + stream


def stream_of(topic: str) -> str:
    """Return the camera's or microphone's name; "" for other topics."""
    for prefix in (CAMERA, MICROPHONE):
        if topic.startswith(prefix):
            return topic[len(prefix) :]
    return ""


@cache
def own_schema(kind: type[OwnRecord]) -> dict[str, Any]:
    """Return the JSON Schema of one kind, complete in itself."""
    (reference,), components = msgspec.json.schema_components([kind], ref_template="#/$defs/{name}")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **components.pop(reference["$ref"].rpartition("/")[2]),
        **({"$defs": dict(sorted(components.items()))} if components else {}),
    }


def _own(topic: str, kind: type[OwnRecord]) -> Topic:
    name = next(name for name, each in OWN_RECORDS.items() if each is kind)
    return Topic(topic, name, "jsonschema", json.dumps(own_schema(kind)).encode(), "json")


def _protobuf(topic: str, kind: type[Message]) -> Topic:
    return Topic(topic, kind.DESCRIPTOR.full_name, "protobuf", _descriptors(kind), "protobuf")


def _descriptors(kind: type[Message]) -> bytes:
    """Return the FileDescriptorSet that MCAP wants as the schema: the message's file and all its dependencies."""
    files: dict[str, Any] = {}  # file descriptors, which the stubs give several types

    def add(file: Any) -> None:
        if file.name not in files:
            for needed in file.dependencies:
                add(needed)
            files[file.name] = file

    add(kind.DESCRIPTOR.file)
    found = FileDescriptorSet()
    for file in files.values():
        file.CopyToProto(found.file.add())
    return found.SerializeToString()
