"""`lockstep export --to rosbag2`: a bag of ROS 2 in MCAP, with CDR messages and metadata.yaml. Needs rosbags.

Pictures are foxglove_msgs/CompressedVideo, as they were recorded: sensor_msgs/CompressedImage has no form for a stream
whose pictures need those before them, and pictures that are encoded anew are no longer the ones that were seen. What
ROS has no message for is std_msgs/String with the JSON of Lockstep's own records, under the topics of the recording.
"""

import re
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import MessageError
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_rows import episodes_now
from lockstep.server.recording.export.rosbag2.ros_messages import COMPRESSED_VIDEO, RosMessages, ros_types
from lockstep.server.recording.export.unfinished import unfinished
from lockstep.server.recording.format.map_messages import MAP_FRAME
from lockstep.server.recording.format.payload import VIDEO, RecordedPicture, own_record
from lockstep.server.recording.format.records import Degraded, FeedbackRecord, MapRecord, NavigationRecord, RobotRecord
from lockstep.server.recording.format.stamp import STAMP_TOPIC, stamp_message
from lockstep.server.recording.format.topics import CAMERA, OWN_TOPICS, SIGNATURE, WRENCH, has_frames, stream_of
from lockstep.server.recording.reading.kept_records import KeptRecords
from lockstep.server.recording.reading.pictures import picture_size
from lockstep.server.recording.reading.reader import Record, RecordingReader
from lockstep.server.recording.writing.writer import Entry

__all__ = ["export"]

FEEDBACK, ROBOT = OWN_TOPICS[FeedbackRecord], OWN_TOPICS[RobotRecord]
DEGRADED = OWN_TOPICS[Degraded]
MAPS, NAVIGATION = OWN_TOPICS[MapRecord], OWN_TOPICS[NavigationRecord]
LATCHED = ("/tf_static", "/map")
TEXTS = set(OWN_TOPICS.values()) - {SIGNATURE, WRENCH}  # what signs the file signs no bag
VERSION: Final = 8  # of metadata.yaml: ROS 2 from Iron on reads it
CANNOT_BE_WRITTEN = (struct.error, OverflowError, ValueError)  # such as a time after 2038
NOT_BOUNDED = QosTime(2147483647, 4294967295)
MOST_NAME = 60  # characters of a camera's name in a topic


def export(path: Path, out: Path | None, task: str, *, kept: bool = False) -> list[Path]:
    """Write and return the bag, a folder: `out`, or one beside `path`. `kept`: what is of kept episodes alone.

    Raises:
        RecordingError: the recording cannot be read.
        OSError: the folder is there already, or cannot be written.
    """
    target = out or path.with_name(f"{path.stem}-rosbag2")
    with RecordingReader(path) as reader:
        description = reader.description()
        if target.exists():
            raise FileExistsError(17, "it is there already", str(target))
        try:
            with (
                unfinished(target) as partial,  # half a bag would be taken for a whole one
                Writer(partial, version=VERSION, storage_plugin=StoragePlugin.MCAP) as writer,
            ):
                bag = _Bag(writer, reader, description)
                kept_records = KeptRecords(episodes_now(reader)) if kept else None
                for record in reader.records():
                    if kept_records is None or kept_records.takes(record):
                        bag.take(record)
                    else:
                        bag.leave_out(record)
        except CANNOT_BE_WRITTEN as error:
            raise RecordingDamaged(f"{path.name}: ROS 2 has no such value: {error}") from error
    return [target]


class _Bag:
    """Writes the records of one recording, in the order of their arrival."""

    def __init__(self, writer: Writer, reader: RecordingReader, description: RobotDescription) -> None:
        self._writer = writer
        self._epoch = reader.info.epoch
        self._description = description
        self._store = ros_types()
        self._messages = RosMessages(self._store)
        self._connections: dict[str, Connection] = {}
        self._joints = [joint.name for joint in description.joints]
        self._cameras = {camera.name: camera for camera in description.cameras}
        self._names = _topic_names(stream_of(each.topic) for each in reader.index.topics if each.schema == VIDEO)
        self._sizes: dict[str, tuple[int, int]] = {}  # of the newest keyframe, by camera
        self._whole: set[str] = set()  # cameras without a loss since their keyframe

    def take(self, record: Record) -> None:
        """Write what becomes of a record. Raises RecordingDamaged."""
        if record.topic.startswith(CAMERA):
            picture = record.picture
            if picture is not None:
                self._picture(record, picture)
        elif record.topic in TEXTS:
            if record.topic == DEGRADED:
                self._whole.clear()
            self._text(record.topic, record.arrived, record.data)
            if record.topic == FEEDBACK:
                self._feedback(own_record(FeedbackRecord, record.data), record)
            elif record.topic in (MAPS, NAVIGATION):
                self._map(record)
            elif record.topic == ROBOT and has_frames(self._description):
                message = self._messages.fixed_transforms(self._description, record.captured)
                self._write("/tf_static", "tf2_msgs/msg/TFMessage", record.arrived, message)

    def leave_out(self, record: Record) -> None:
        """Leave a record out; pictures that build on it are left out until the next keyframe."""
        if record.topic == DEGRADED:
            self._whole.clear()
        else:
            self._whole.discard(record.topic.removeprefix(CAMERA))

    def _picture(self, record: Record, picture: RecordedPicture) -> None:
        camera = record.topic.removeprefix(CAMERA)
        if picture.keyframe:
            self._whole.add(camera)
            self._sizes[camera] = picture_size(picture) or self._sizes.get(camera, (0, 0))
        if camera not in self._whole:
            return  # it cannot be decoded
        topic = f"/camera/{self._names[camera]}"
        video = self._messages.video(camera, record.captured, picture.data, picture.format)
        self._write(topic, COMPRESSED_VIDEO, record.arrived, video)
        entry = Entry(record.topic, record.event, record.arrived, record.captured, b"")
        self._text(STAMP_TOPIC.name, record.arrived, stamp_message(entry, self._epoch))
        known = self._cameras.get(camera)
        if known is not None and known.calibration is not None and all(self._sizes[camera]):
            info = self._messages.camera_info(known, known.calibration, record.captured, self._sizes[camera])
            self._write(f"{topic}/camera_info", "sensor_msgs/msg/CameraInfo", record.arrived, info)

    def _feedback(self, feedback: FeedbackRecord, record: Record) -> None:
        description, messages, time = self._description, self._messages, record.captured
        joints = dict(zip(self._joints, feedback.joints, strict=False))
        if joints:
            states = messages.joints(list(joints), list(joints.values()), time)
            self._write("/joint_states", "sensor_msgs/msg/JointState", record.arrived, states)
        if any(body.joints for body in description.bodies):
            moving = messages.moving_transforms(description, joints, time)
            self._write("/tf", "tf2_msgs/msg/TFMessage", record.arrived, moving)
        base = description.planar_base
        if base is not None and {base.x, base.y, base.yaw} <= joints.keys():
            odometry = messages.odometry(description, base, feedback, joints, time)
            self._write("/odom", "nav_msgs/msg/Odometry", record.arrived, odometry)
        if description.wrench is not None and len(feedback.wrench) == 6:
            wrench = messages.wrench(description.wrench, feedback.wrench, time)
            self._write("/wrench", "geometry_msgs/msg/WrenchStamped", record.arrived, wrench)
        if description.ranges is not None and feedback.ranges:
            scan = messages.scan(description.ranges, feedback.ranges, time)
            self._write("/scan", "sensor_msgs/msg/LaserScan", record.arrived, scan)

    def _map(self, record: Record) -> None:
        """Write the grid, or where its frame is; a body may have the name of that frame."""
        if self._description.map is None or any(body.name == MAP_FRAME for body in self._description.bodies):
            return
        if record.topic == NAVIGATION:
            navigation = own_record(NavigationRecord, record.data)
            if navigation.located:
                message = self._messages.map_frame(navigation.frame, record.captured)
                self._write("/tf", "tf2_msgs/msg/TFMessage", record.arrived, message)
            return
        try:
            grid = self._messages.grid(own_record(MapRecord, record.data).map, record.captured)
        except MessageError:
            return  # its cells are not what it says
        self._write("/map", "nav_msgs/msg/OccupancyGrid", record.arrived, grid)

    def _text(self, topic: str, arrived: int, data: bytes) -> None:
        self._write(topic, "std_msgs/msg/String", arrived, self._messages.text(data.decode(errors="replace")))

    def _write(self, topic: str, kind: str, arrived: int, message: Any) -> None:
        connection = self._connections.get(topic)
        if connection is None:
            qos = _qos(latched=topic in LATCHED)
            connection = self._writer.add_connection(topic, kind, typestore=self._store, offered_qos_profiles=[qos])
            self._connections[topic] = connection
        self._writer.write(connection, arrived, self._store.serialize_cdr(message, kind))


def _topic_names(cameras: Iterable[str]) -> dict[str, str]:
    """Return a name that ROS permits in a topic for each camera; no two are the same."""
    names: dict[str, str] = {}
    for camera in cameras:
        name = re.sub(r"[^A-Za-z0-9_]", "_", camera)[:MOST_NAME]
        name = name if name[:1].isalpha() else f"c{name}"
        while name in names.values():
            name += "_"
        names[camera] = name
    return names


def _qos(*, latched: bool) -> Qos:
    """Return what a publisher of this topic would offer: /tf_static and /map are kept for those who come later."""
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=NOT_BOUNDED,
        lifespan=NOT_BOUNDED,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=NOT_BOUNDED,
        avoid_ros_namespace_conventions=False,
    )
