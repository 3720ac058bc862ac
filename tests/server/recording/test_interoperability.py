"""A recording is taken by viewers' own libraries. Where rerun-sdk is not installed that part says nothing."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import jsonschema
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from foxglove.messages import CameraCalibration, CompressedVideo, FrameTransforms, Odometry, SceneUpdate
from foxglove.messages import JointStates as SdkJointStates
from foxglove_schemas_protobuf.CompressedAudio_pb2 import CompressedAudio
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo as Message
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.decoder import DecoderFactory as McapDecoderFactory
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.server.evidence.signer import Signer
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import RobotRecord, WrenchRecord
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.format.topics import topics_of
from lockstep.server.recording.writing.queue_items import FeedbackItem, RobotItem, entries_of
from lockstep.server.recording.writing.writer import RecordingWriter
from tests.server.recording.makers import EPOCH, INFO, SECOND, START, Story

EVENTS = 60


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    signing = RecordingSigning(Signer(Ed25519PrivateKey.generate()), lambda: "")
    Story(events=EVENTS, real=True).write(path, signing=signing)
    return path


def test_pictures_decode_with_pyav_one_for_each_message(file: Path) -> None:
    decoder = av.CodecContext.create("h264", "r")
    with file.open("rb") as stream:
        for _, _, message in make_reader(stream).iter_messages(topics=["/camera/front"]):
            (frame,) = decoder.decode(av.Packet(Message.FromString(message.data).data))
            assert (frame.width, frame.height) == (320, 240)


def test_sound_decodes_with_pyav(file: Path) -> None:
    decoder = av.CodecContext.create("libopus", "r")
    decoder.sample_rate, decoder.layout = 48_000, "mono"
    with file.open("rb") as stream:
        packets = [
            CompressedAudio.FromString(message.data)
            for _, _, message in make_reader(stream).iter_messages(topics=["/microphone/ear"])
        ]
    assert {packet.format for packet in packets} == {"opus"}
    assert sum(frame.samples for packet in packets for frame in decoder.decode(av.Packet(packet.data))) > 50_000


def test_schemas_are_those_of_the_foxglove_sdk(file: Path) -> None:
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    schemas = {schema.name: schema for schema in summary.schemas.values()}
    for kind in (CompressedVideo, SdkJointStates):
        theirs = kind.get_schema()
        assert (schemas[theirs.name].name, schemas[theirs.name].encoding) == (theirs.name, theirs.encoding)
    with file.open("rb") as stream:
        _, _, message = next(make_reader(stream).iter_messages(topics=["/joint_states"]))
    assert [joint.name for joint in JointStates.FromString(message.data).joints] == ["x", "y", "yaw"]


def test_every_message_decodes_by_the_schema_that_is_in_the_file(file: Path) -> None:
    """By libraries that know nothing of Lockstep: mcap-protobuf-support, and a JSON Schema validator."""
    seen = dict[str, int]()
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory(), JsonFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
            match channel.topic, message.sequence:
                case "/wrench", 2:
                    assert (decoded.force.x, decoded.frame_id, decoded.event) == (0.1, "base", 2)
                case "/axis_commands", 31:
                    commanded = [(axis.name, axis.value, axis.unit) for axis in decoded.axes]
                    assert commanded == [("base.vx", 0.5, "m/s"), ("base.wz", 0.0, "m/s")]
                    assert (decoded.driver, decoded.event) == ("Ada", 31)
                case "/axis_states", 31:
                    measured = [(axis.name, axis.measured, axis.HasField("goal")) for axis in decoded.axes]
                    assert measured == [("base.vx", 0.5, False), ("base.wz", 0.0, False)]
    assert seen["/axis_states"] == seen["/wrench"] == seen["/odom"] == EVENTS
    assert seen["/axis_commands"] == EVENTS - 1


class JsonFactory(McapDecoderFactory):
    """Decodes JSON that its schema permits."""

    def decoder_for(self, message_encoding: str, schema: Schema | None) -> Callable[[bytes], Any] | None:
        if message_encoding != "json" or schema is None:
            return None
        validator = jsonschema.Draft202012Validator(json.loads(schema.data))

        def decode(data: bytes) -> Any:
            message = json.loads(data)
            validator.validate(message)
            return message

        return decode


def test_a_wrench_of_an_earlier_file_is_read() -> None:
    data = b'{"epoch":"e","event":3,"frame_id":"base","force":{"x":1,"y":2,"z":3},"torque":{"x":4,"y":5,"z":6}}'
    found = own_record_of("lockstep.Wrench", data)
    assert isinstance(found, WrenchRecord)
    assert found.force.z == 3


@pytest.mark.parametrize("kind", [CameraCalibration, FrameTransforms, Odometry, SceneUpdate])
def test_the_fields_of_frames_shapes_and_odometry_are_those_of_the_foxglove_sdk(
    kind: type[CameraCalibration] | type[FrameTransforms] | type[Odometry] | type[SceneUpdate],
) -> None:
    theirs = kind.get_schema()
    topics = topics_of(create_robot("mobile-manipulator").describe(), {})
    ours = next(topic for topic in topics if topic.schema == theirs.name)
    assert _fields(ours.schema_data) == _fields(theirs.data)


def _fields(schema: bytes) -> set[tuple[str, str, int, int, str]]:
    """Message, name, number, type and message type of every field in a schema."""
    return {
        (message.name, field.name, field.number, field.type, field.type_name)
        for file in FileDescriptorSet.FromString(schema).file
        for message in file.message_type
        for field in message.field
    }


def test_rerun_loads_frames_shapes_and_odometry(tmp_path: Path) -> None:
    description = create_robot("mobile-manipulator").describe()
    file = tmp_path / "a.mcap"
    writer = RecordingWriter(file, INFO, description, {})
    robot = RobotItem(START, RobotRecord(epoch=EPOCH, event=1, link="up", description=description), {})
    joints = [0.1] * len(description.joints)
    for number in range(1, 10):
        feedback = Feedback(
            event=number, issue=1, time=float(number), axes=[0.0] * len(description.axes), joints=joints
        )
        at = START + number * SECOND // 25
        for entry in (
            *(entries_of(robot, description) if number == 1 else ()),
            *entries_of(FeedbackItem(at, at, EPOCH, feedback), description),
        ):
            writer.write(entry)
    assert writer.close().lost == 0
    loaded = _loaded_by_rerun(file, tmp_path)
    for topic in ("/tf", "/tf_static", "/robot_shapes", "/odom"):
        assert topic.encode() in loaded


@pytest.mark.parametrize(("codec", "sounds"), [("H264", ("opus",)), ("VP8", ("opus", "PCMU"))])
def test_rerun_loads_it(codec: str, sounds: tuple[str, ...], tmp_path: Path) -> None:
    """With pictures in VP8, or sound in G.711, all the rest: it knows neither."""
    file = tmp_path / "a.mcap"
    signing = RecordingSigning(Signer(Ed25519PrivateKey.generate()), lambda: "")
    Story(events=EVENTS, real=True, codecs=(codec,), sounds=sounds).write(file, signing=signing)
    loaded = _loaded_by_rerun(file, tmp_path)
    assert b"/camera/front" in loaded
    assert b"/lockstep/feedback" in loaded


def _loaded_by_rerun(file: Path, folder: Path) -> bytes:
    rerun = pytest.importorskip("rerun")
    target = folder / "a.rrd"
    recording = rerun.RecordingStream("lockstep-test")
    recording.save(str(target))
    recording.log_file_from_path(str(file))
    recording.flush()
    recording.disconnect()
    return target.read_bytes()
