"""What Rerun's own library reads from an export is what the recording has, by event."""

import math
from pathlib import Path

import av
import msgspec
import pytest

from lockstep.protocol.description import Axis, Geom, RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.server.recording.format.records import CommandRecord, Degraded, FeedbackRecord, RobotRecord
from lockstep.server.recording.format.topics import CAMERA, OWN_TOPICS
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.writing.queue_items import FeedbackItem, OwnItem, RobotItem, entries_of
from lockstep.server.recording.writing.writer import RecordingWriter
from lockstep.server.scene.kinematics import body_pose
from tests.server.recording.makers import EPOCH, INFO, INTERVAL, SECOND, START, Story, own_entry, rewritten
from tests.server.recording.rrd import entities, recording_ids, rerun
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording

from lockstep.server.recording.export import export_rerun  # isort: skip  (needs rerun, which `rrd` looks for)

EVENTS = 60


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    Story(first_event=1000, events=EVENTS, force_at=20, real=True).write(path)
    return path


def test_each_event_is_one_row_with_the_values_of_its_feedback(file: Path, tmp_path: Path) -> None:
    (target,) = export_rerun.export(file, tmp_path / "a.rrd", "")
    found = entities(target)
    assert recording_ids(target) == [f"{INFO.recording}-{EPOCH}"]
    with RecordingReader(file) as reader:
        records = list(reader.records(topics={OWN_TOPICS[FeedbackRecord]}))
    feedback = [msgspec.json.decode(record.data, type=FeedbackRecord) for record in records]
    assert len(feedback) == EVENTS
    for path, values in (
        ("/axes/measured", [each.axes for each in feedback]),
        ("/joints", [each.joints for each in feedback]),
        ("/wrench/force", [each.wrench[:3] for each in feedback]),
        ("/state/stopped", [[0.0]] * EVENTS),
    ):
        entity = found[path]
        assert entity.column("event") == [each.event for each in feedback] == list(range(1000, 1000 + EVENTS))
        assert entity.column("arrived") == [record.arrived for record in records]
        assert entity.column("captured") == [record.captured for record in records]
        assert entity.column("Scalars:scalars") == [pytest.approx(row) for row in values]
    assert found["/axes/measured"].static[0]["SeriesLines:names"] == ["base.vx", "base.wz"]
    commands = found["/axes/commanded"]
    assert commands.column("event") == list(range(1001, 1000 + EVENTS))
    assert commands.column("Scalars:scalars")[29] == [0.5, 0.0]


def test_pictures_are_the_recorded_ones_on_the_event_of_their_stamp_and_decode(file: Path, tmp_path: Path) -> None:
    (target,) = export_rerun.export(file, tmp_path / "a.rrd", "")
    camera = entities(target)["/camera/front"]
    with RecordingReader(file) as reader:
        records = list(reader.records(topics={CAMERA + "front"}))
    assert camera.column("event") == [record.event for record in records]
    samples = [bytes(sample[0]) for sample in camera.column("VideoStream:sample")]
    assert samples == [record.payload for record in records]
    assert [key for (key,) in camera.column("VideoStream:is_keyframe")] == [record.keyframe for record in records]
    assert rerun.VideoCodec.H264.value in camera.static[0]["VideoStream:codec"]
    decoder = av.CodecContext.create("h264", "r")
    assert sum(len(decoder.decode(av.Packet(sample))) for sample in samples) == EVENTS - 1


def test_no_picture_builds_on_one_that_the_recorder_left_out(tmp_path: Path) -> None:
    """Keyframes are those of events 2 and 52; something was left out before the picture of event 40."""
    lost = own_entry(Degraded(epoch=EPOCH, event=40, lost=3), START + 39 * INTERVAL + 4_000_000)
    entries = sorted([*Story(events=EVENTS, real=True).entries(), lost], key=lambda each: each.arrived)
    path = rewritten(tmp_path / "a.mcap", entries, lambda each: [each])
    (target,) = export_rerun.export(path, tmp_path / "a.rrd", "")
    assert entities(target)["/camera/front"].column("event") == [*range(2, 40), *range(52, EVENTS + 1)]


def test_pictures_of_two_codecs_are_two_streams(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=120, real=True, codecs=("H264", "VP8")).write(path)
    (target,) = export_rerun.export(path, None, "")
    assert target == path.with_suffix(".rrd")
    found = entities(target)
    h264, vp8 = found["/camera/front"], found["/camera/front/vp8"]
    assert len(h264.rows) + len(vp8.rows) == 119
    assert rerun.VideoCodec.VP8.value in vp8.static[0]["VideoStream:codec"]


def test_bodies_are_where_the_kinematics_put_them_and_cameras_where_their_calibration_says(tmp_path: Path) -> None:
    description = create_robot("mobile-manipulator").describe()
    joints = [0.1 + 0.02 * number for number in range(len(description.joints))]
    path = tmp_path / "a.mcap"
    _write(path, description, [joints])
    (target,) = export_rerun.export(path, None, "")
    found = entities(target)
    values = dict(zip((joint.name for joint in description.joints), joints, strict=True))
    moved = [body for body in description.bodies if body.joints]
    assert moved
    for body in description.bodies:
        (entity,) = (each for name, each in found.items() if name.endswith(f"/{body.name}"))
        pose = body_pose(body, values)
        (row,) = entity.rows if body.joints else entity.static
        assert row["Transform3D:translation"][0] == pytest.approx(pose.position, abs=1e-6)
        w, x, y, z = pose.orientation
        assert row["Transform3D:quaternion"][0] == pytest.approx((x, y, z, w), abs=1e-6)
    (wrist,) = (each for name, each in found.items() if name.endswith("/tool/camera/wrist"))
    (calibration,) = (camera.calibration for camera in description.cameras if camera.name == "wrist")
    assert calibration is not None
    (matrix,) = next(row["Pinhole:image_from_camera"] for row in wrist.static if "Pinhole:image_from_camera" in row)
    assert matrix == pytest.approx([calibration.fx, 0, 0, 0, calibration.fy, 0, calibration.cx, calibration.cy, 1])


def test_shapes_are_whole_and_a_capsule_reaches_as_far_as_the_descriptions(tmp_path: Path) -> None:
    body = msgspec.structs.replace(
        create_robot("planar").describe().bodies[0],
        geoms=(
            Geom(shape="box", size=(1.0, 2.0, 3.0)),
            Geom(shape="sphere", size=(0.5, 0.0, 0.0)),
            Geom(shape="cylinder", size=(0.5, 2.0, 0.0)),
            Geom(shape="capsule", size=(0.25, 1.0, 0.0), position=(0.0, 0.0, 3.0)),
            Geom(shape="mesh", vertices=(0, 0, 0, 1, 0, 0, 0, 2, 0), triangles=(0, 1, 2), position=(0.0, 0.0, 4.0)),
        ),
    )
    axis = Axis(name="a/b c", label="A", unit="m", minimum=-1.0, maximum=1.0, slew=1.0, brake=1.0, kind="goal", reach=1)
    description = RobotDescription(name="r", label="R", axes=(axis,), bodies=(body,))
    path = tmp_path / "a.mcap"
    _write(path, description, [[]], goals=[None])
    (target,) = export_rerun.export(path, None, "")
    found = entities(target)
    assert found["/robot/room/box"].static[0]["Boxes3D:half_sizes"] == [[1.0, 2.0, 3.0]]
    assert found["/robot/room/sphere"].static[0]["Ellipsoids3D:half_sizes"] == [[0.5, 0.5, 0.5]]
    assert found["/robot/room/cylinder"].static[0]["Cylinders3D:lengths"] == [4.0]
    capsule = found["/robot/room/capsule"].static[0]
    assert (capsule["Capsules3D:lengths"], capsule["Capsules3D:translations"]) == ([2.0], [[0.0, 0.0, 2.0]])
    mesh = {name: value for row in found["/robot/room/mesh/0"].static for name, value in row.items()}
    assert mesh["Mesh3D:vertex_positions"] == [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]
    assert mesh["Mesh3D:triangle_indices"] == [[0, 1, 2]]
    assert mesh["Transform3D:translation"] == [[0.0, 0.0, 4.0]]
    (goal,) = found["/axes/goals"].column("Scalars:scalars")
    assert math.isnan(goal[0])


def _write(
    path: Path, description: RobotDescription, joints: list[list[float]], goals: list[float | None] | None = None
) -> None:
    writer = RecordingWriter(path, INFO, description, {})
    items: list[RobotItem | FeedbackItem | OwnItem] = [
        RobotItem(START, RobotRecord(epoch=EPOCH, event=1, link="up", description=description), {})
    ]
    for number, row in enumerate(joints, start=1):
        at = START + number * SECOND // 25
        feedback = Feedback(
            event=number,
            issue=1,
            time=float(number),
            axes=[0.0] * len(description.axes),
            joints=row,
            goals=goals or [],
        )
        items.append(FeedbackItem(at, at, EPOCH, feedback))
    for item in items:
        for entry in entries_of(item, description):
            writer.write(entry)
    assert writer.close().lost == 0


def test_a_command_that_was_refused_is_no_row(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    description = create_robot("planar").describe()
    writer = RecordingWriter(path, INFO, description, {})
    robot = RobotItem(START, RobotRecord(epoch=EPOCH, event=1, link="up", description=description), {})
    refused = CommandRecord(
        epoch=EPOCH, event=2, issue=1, values=[0.0] * 3, peer="p", name="Ada", outcome="refused", reason="late"
    )
    for item in (robot, OwnItem(START, refused)):
        for entry in entries_of(item, description):
            writer.write(entry)
    writer.close()
    (target,) = export_rerun.export(path, None, "")
    assert entities(target)["/axes/commanded"].rows == []


def test_with_kept_a_file_has_nothing_of_what_is_in_no_kept_episode(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (target,) = export_rerun.export(path, tmp_path / "a.rrd", "", kept=True)
    found = entities(target)
    kept = [*range(11, 21), *range(46, 61)]
    assert found["/axes/measured"].column("event") == kept
    for name, entity in found.items():
        said = {1, 10, 45} if name == "/log" else set()  # what the robot is, and begins of the kept ones
        assert set(entity.column("event")) <= {*kept, *said}, name
