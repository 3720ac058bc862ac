"""A bag of an export, read by rosbags, by the mcap library with the schemas in the file, and by ROS 2 itself."""

import json
import subprocess
import zlib
from pathlib import Path
from typing import Any

import av
import msgspec
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from lockstep.protocol.maps import OccupancyMap
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.format.records import (
    Degraded,
    EpisodeRecord,
    FeedbackRecord,
    MapRecord,
    NavigationRecord,
    RobotRecord,
)
from lockstep.server.recording.format.robot_frames import WORLD
from lockstep.server.recording.format.topics import CAMERA, OWN_TOPICS
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.writing.queue_items import FeedbackItem, RobotItem, entries_of
from lockstep.server.recording.writing.writer import Entry, RecordingWriter
from lockstep.server.scene.kinematics import body_pose
from tests.server.recording.makers import EPOCH, INFO, INTERVAL, SECOND, START, Story, own_entry, rewritten
from tests.server.recording.test_episode_export import KEPT_AND_NOT, changed, recording
from tests.support.ros2 import have_ros, ros_python

pytest.importorskip("rosbags")
from rosbags.rosbag2 import Reader

from lockstep.server.recording.export import export_rosbag2
from lockstep.server.recording.export.rosbag2.ros_messages import ros_types

EVENTS = 60
TYPES = ros_types()
DECODES = """
import json, sys
from importlib import import_module
from rclpy.serialization import deserialize_message
for line in sys.stdin:
    kind, data = json.loads(line)
    package, _, name = kind.split("/")
    message = deserialize_message(bytes.fromhex(data), getattr(import_module(package + ".msg"), name))
    print(json.dumps(str(message)), flush=True)
"""


class Message:
    def __init__(self, topic: str, kind: str, at: int, data: bytes) -> None:
        self.topic, self.kind, self.at, self.data = topic, kind, at, data
        self.decoded: Any = TYPES.deserialize_cdr(data, kind)


def read(bag: Path) -> dict[str, list[Message]]:
    """The messages of a bag by topic, as rosbags reads them."""
    found: dict[str, list[Message]] = {}
    with Reader(bag) as reader:
        for connection, at, data in reader.messages():
            message = Message(connection.topic, connection.msgtype, at, bytes(data))
            found.setdefault(connection.topic, []).append(message)
    return found


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    Story(events=EVENTS, force_at=20, real=True).write(path)
    return path


@pytest.fixture(scope="module")
def bag(file: Path) -> Path:
    (target,) = export_rosbag2.export(file, None, "")
    assert target == file.with_name("a-rosbag2")
    return target


def test_it_has_the_values_of_each_feedback_at_its_times(file: Path, bag: Path) -> None:
    with RecordingReader(file) as reader:
        records = list(reader.records(topics={OWN_TOPICS[FeedbackRecord]}))
    found = read(bag)
    states, wrenches, odometry, scans = (found[name] for name in ("/joint_states", "/wrench", "/odom", "/scan"))
    assert len(records) == len(states) == len(wrenches) == len(odometry) == len(scans) == EVENTS
    for record, state, wrench, odom, scan in zip(records, states, wrenches, odometry, scans, strict=True):
        feedback = json.loads(record.data)
        for message in (state, wrench, odom, scan):
            stamp = message.decoded.header.stamp
            assert (message.at, stamp.sec * SECOND + stamp.nanosec) == (record.arrived, record.captured)
        assert state.decoded.name == ["x", "y", "yaw"]
        assert list(state.decoded.position) == feedback["joints"]
        assert (wrench.decoded.wrench.force.x, wrench.decoded.header.frame_id) == (feedback["wrench"][0], "base")
        assert odom.decoded.pose.pose.position.x == feedback["joints"][0]
        assert (odom.decoded.header.frame_id, odom.decoded.twist.twist.linear.x) == (WORLD, feedback["axes"][0])
        assert list(scan.decoded.ranges) == feedback["ranges"]
    texts = [json.loads(each.decoded.data) for each in found["/lockstep/feedback"]]
    assert texts == [json.loads(record.data) for record in records]
    assert "/lockstep/signature" not in found


def test_pictures_are_the_recorded_ones_with_the_event_of_each_beside_them(file: Path, bag: Path) -> None:
    with RecordingReader(file) as reader:
        records = list(reader.records(topics={CAMERA + "front"}))
    found = read(bag)
    pictures = found["/camera/front"]
    assert [bytes(each.decoded.data) for each in pictures] == [record.payload for record in records]
    assert {each.decoded.format for each in pictures} == {"h264"}
    stamps = [json.loads(each.decoded.data) for each in found["/lockstep/stamp"]]
    assert [(each["event"], each["stream"]) for each in stamps] == [(record.event, "front") for record in records]
    for picture, stamp in zip(pictures, stamps, strict=True):
        at = picture.decoded.timestamp
        assert (at.sec, at.nanosec) == (stamp["timestamp"]["sec"], stamp["timestamp"]["nsec"])
    decoder = av.CodecContext.create("h264", "r")
    assert sum(len(decoder.decode(av.Packet(bytes(each.decoded.data)))) for each in pictures) == EVENTS - 1


def test_no_picture_builds_on_one_that_the_recorder_left_out(tmp_path: Path) -> None:
    """Keyframes are those of events 2 and 52; something was left out before the picture of event 40."""
    lost = own_entry(Degraded(epoch=EPOCH, event=40, lost=3), START + 39 * INTERVAL + 4_000_000)
    entries = sorted([*Story(events=EVENTS, real=True).entries(), lost], key=lambda each: each.arrived)
    path = rewritten(tmp_path / "a.mcap", entries, lambda each: [each])
    (out,) = export_rosbag2.export(path, tmp_path / "bag", "")
    found = read(out)
    assert len(found["/camera/front"]) == 38 + EVENTS - 51
    assert len(found["/lockstep/degraded"]) == 1


def test_the_mcap_library_decodes_every_message_by_the_schemas_in_the_file(bag: Path) -> None:
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (metadata["storage_identifier"], metadata["relative_file_paths"]) == ("mcap", [f"{bag.name}.mcap"])
    counted: dict[str, int] = {}
    with (bag / f"{bag.name}.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, _, decoded in reader.iter_decoded_messages():
            assert schema is not None
            assert schema.encoding == "ros2msg"
            assert decoded is not None
            counted[channel.topic] = counted.get(channel.topic, 0) + 1
    named = {each["topic_metadata"]["name"]: each["message_count"] for each in metadata["topics_with_message_count"]}
    assert counted == named
    assert metadata["message_count"] == sum(counted.values())


@pytest.mark.skipif(not have_ros(), reason="ROS 2 is not installed for the tests")
def test_ros_2_decodes_its_own_messages(bag: Path) -> None:
    """By rclpy, one of each topic; it has neither tf2_msgs nor foxglove_msgs there."""
    found = [messages[0] for messages in read(bag).values()]
    packages = ("sensor_msgs", "nav_msgs", "geometry_msgs", "std_msgs")
    known = [each for each in found if each.kind.split("/")[0] in packages]
    assert len({each.kind for each in known}) >= 5
    asked = "".join(json.dumps([each.kind, each.data.hex()]) + "\n" for each in known)
    done = subprocess.run(
        [str(ros_python()), "-c", DECODES],
        input=asked,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    said = dict(zip((each.topic for each in known), map(json.loads, done.stdout.splitlines()), strict=True))
    assert "name=['x', 'y', 'yaw']" in said["/joint_states"]
    assert "child_frame_id=''" in said["/odom"]
    assert "force=geometry_msgs.msg.Vector3(x=0.1" in said["/wrench"]


def test_frames_and_calibrations_are_those_of_the_description(tmp_path: Path) -> None:
    robot = create_robot("mobile-manipulator").describe()
    (wrist,) = (camera for camera in robot.cameras if camera.name == "wrist")
    assert wrist.calibration is not None
    named = msgspec.structs.replace(wrist, name="front")
    description = msgspec.structs.replace(robot, cameras=(named,))
    joints = [0.1 + 0.02 * number for number in range(len(description.joints))]
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, INFO, description, {"front": "H264"})
    record = RobotRecord(epoch=EPOCH, event=1, link="up", description=description)
    feedback = Feedback(event=1, issue=1, time=1.0, axes=[0.0] * len(description.axes), joints=joints)
    entries = [
        *entries_of(RobotItem(START, record, {}), description),
        *entries_of(FeedbackItem(START + 1, START, EPOCH, feedback), description),
        *(entry for entry in Story(events=3, real=True).entries() if entry.topic == CAMERA + "front"),
    ]
    for entry in entries:
        writer.write(entry)
    writer.close()
    (target,) = export_rosbag2.export(path, tmp_path / "bag", "")
    found = read(target)
    ((fixed,), (moving,)) = found["/tf_static"], found["/tf"]
    values = dict(zip((joint.name for joint in description.joints), joints, strict=True))
    frames = {each.child_frame_id: each for each in (*fixed.decoded.transforms, *moving.decoded.transforms)}
    assert frames.keys() == {"front", *(body.name for body in description.bodies)}
    for body in description.bodies:
        pose, at = body_pose(body, values), frames[body.name].transform.translation
        assert (at.x, at.y, at.z) == pytest.approx(pose.position)
        assert frames[body.name].header.frame_id == (body.parent or WORLD)
    infos = found["/camera/front/camera_info"]
    assert len(infos) == len(found["/camera/front"]) == 2
    calibration = named.calibration
    assert calibration is not None
    assert infos[0].decoded.k[0] == pytest.approx(calibration.fx)
    assert (infos[0].decoded.width, infos[0].decoded.header.frame_id) == (320, "front")
    metadata = yaml.safe_load((target / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    (latched,) = (
        yaml.safe_load(each["topic_metadata"]["offered_qos_profiles"])
        for each in metadata["topics_with_message_count"]
        if each["topic_metadata"]["name"] == "/tf_static"
    )
    assert latched[0]["durability"] == 1  # transient local


def test_names_that_ros_does_not_permit_are_changed_and_stay_apart(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    cameras = ("arm.eye", "arm/eye", "2", "", "ünder")
    writer = RecordingWriter(path, INFO, create_robot("planar").describe(), dict.fromkeys(cameras, "H264"))
    robot = RobotRecord(epoch=EPOCH, event=1, link="up", description=create_robot("planar").describe())
    for entry in entries_of(RobotItem(START, robot, {}), robot.description):
        writer.write(entry)
    for entry in Story(events=3, real=True).entries():
        if entry.topic == CAMERA + "front":
            for camera in cameras:
                writer.write(entry._replace(topic=CAMERA + camera))
    writer.close()
    (target,) = export_rosbag2.export(path, None, "")
    topics = {topic for topic in read(target) if topic.startswith("/camera/")}
    assert topics == {"/camera/arm_eye", "/camera/arm_eye_", "/camera/c2", "/camera/c", "/camera/c_nder"}


def test_a_folder_that_is_there_is_left_alone(file: Path, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "mine").write_text("kept")
    with pytest.raises(FileExistsError):
        export_rosbag2.export(file, tmp_path / "bag", "")
    assert (tmp_path / "bag" / "mine").read_text() == "kept"


def test_a_time_that_ros_cannot_hold_is_told_and_leaves_no_half_bag(tmp_path: Path) -> None:
    def late(entry: Entry) -> list[Entry]:
        return [entry._replace(captured=(1 << 40) * SECOND // 64)]

    path = rewritten(tmp_path / "a.mcap", Story(events=5).entries(), late)
    with pytest.raises(RecordingDamaged, match="ROS 2 has no such value"):
        export_rosbag2.export(path, tmp_path / "bag", "")
    assert not (tmp_path / "bag").exists()


def test_the_map_is_an_occupancy_grid_whose_frame_is_placed_in_the_world(tmp_path: Path) -> None:
    planar = create_robot("planar").describe()
    cells = bytes([0, 100, 255, 50, 0, 0])
    map = OccupancyMap(id="a", width=3, height=2, resolution=0.5, origin=(1.0, -2.0, 0.0), cells=zlib.compress(cells))
    false = msgspec.structs.replace(map, width=4)
    at = START + SECOND
    entries = [
        own_entry(RobotRecord(epoch=EPOCH, event=1, link="up", description=planar), START),
        own_entry(MapRecord(epoch=EPOCH, event=5, map=map), at),
        own_entry(NavigationRecord(epoch=EPOCH, event=5, frame=(1.0, 0.5, 0.0)), at),
        own_entry(NavigationRecord(epoch=EPOCH, event=6, located=False), at),
        own_entry(MapRecord(epoch=EPOCH, event=7, map=false), at),
    ]
    path = rewritten(tmp_path / "a.mcap", entries, lambda each: [each], planar)
    (target,) = export_rosbag2.export(path, None, "")
    messages = read(target)
    (grid,) = messages["/map"]
    assert grid.decoded.data.tolist() == [0, 100, -1, 50, 0, 0]
    assert (grid.decoded.info.width, grid.decoded.info.origin.position.y, grid.decoded.header.frame_id) == (
        3,
        -2.0,
        "map",
    )
    (frames,) = messages["/tf"]
    (transform,) = frames.decoded.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == (WORLD, "map")
    assert (transform.transform.translation.x, transform.transform.translation.y) == (-1.0, -0.5)


def test_with_kept_a_bag_has_nothing_of_what_is_in_no_kept_episode(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    changed(path, "c", last_event=55)
    (bag,) = export_rosbag2.export(path, tmp_path / "bag", "", kept=True)
    found = read(bag)
    kept = {*range(11, 21), *range(46, 56)}
    feedback = [json.loads(each.decoded.data)["event"] for each in found[OWN_TOPICS[FeedbackRecord]]]
    assert set(feedback) == kept
    assert len(found["/joint_states"]) == len(feedback)
    stamps = [json.loads(each.decoded.data)["event"] for each in found["/lockstep/stamp"]]
    assert stamps
    assert set(stamps) <= kept
    assert len(found["/camera/front"]) == len(stamps)
    decoder = av.CodecContext.create("h264", "r")
    for each in found["/camera/front"]:
        decoder.decode(av.Packet(bytes(each.decoded.data)))  # what it builds on is there
    episodes = {json.loads(each.decoded.data)["episode"] for each in found[OWN_TOPICS[EpisodeRecord]]}
    assert episodes == {"a", "c"}
    assert set(found) <= set(read(export_rosbag2.export(path, tmp_path / "whole", "")[0]))
