"""Recordings that tests make: a robot of two axes with a camera, a microphone and a force sensor."""

from collections.abc import Iterator
from pathlib import Path

import msgspec

from robot_bridge.protocol.description import (
    Axis,
    Camera,
    Joint,
    Microphone,
    PlanarBase,
    RangeRing,
    RobotDescription,
    WrenchSensor,
)
from robot_bridge.protocol.messages import StopState
from robot_bridge.protocol.serial import event_after
from server.recording.foxglove import camera_message, feedback_messages, sound_message
from server.recording.info import RecordingInfo
from server.recording.records import CommandRecord, FeedbackRecord, OwnRecord, RobotRecord, SeatRecord
from server.recording.topics import CAMERA, MICROPHONE, OWN_TOPICS
from server.recording.writer import Entry, RecordingWriter

__all__ = ["DESCRIPTION", "EPOCH", "INFO", "SECOND", "START", "Story", "own_entry"]

EPOCH = "epoch-1"
SECOND = 1_000_000_000  # ns
START = 1_800_000_000 * SECOND
INFO = RecordingInfo(recording="20270115-planar-ab12", epoch=EPOCH, robot="Planar robot", name="first", by="Ada")
DESCRIPTION = RobotDescription(
    name="planar",
    label="Planar robot",
    axes=tuple(
        Axis(name=name, label=name, unit="m/s", minimum=-1.0, maximum=1.0, slew=5.0, brake=10.0)
        for name in ("base.vx", "base.wz")
    ),
    joints=tuple(Joint(name=name, unit="m" if name != "yaw" else "rad") for name in ("x", "y", "yaw")),
    cameras=(Camera(name="front", label="Front", width=320, height=240, frame_rate=25.0),),
    microphones=(Microphone(name="ear", label="Ear", sample_rate=48_000),),
    wrench=WrenchSensor(name="wrist", body="base", threshold_force=2.0, full_scale_force=20.0, full_scale_torque=2.0),
    ranges=RangeRing(
        name="ring", body="base", count=3, angle_min=0.0, angle_increment=1.0, range_min=0.1, range_max=4.0
    ),
    planar_base=PlanarBase(x="x", y="y", yaw="yaw", forward="base.vx", turn="base.wz"),
)
KEYFRAME = b"\0\0\0\1\x67sps\0\0\0\1\x68pps\0\0\1\x65"
PICTURE = b"\0\0\0\1\x41"


def own_entry(record: OwnRecord, at: int, captured: int | None = None) -> Entry:
    topic = OWN_TOPICS[type(record)]
    return Entry(
        topic, record.event, at, at if captured is None else captured, msgspec.json.encode(record), False, record
    )


class Story:
    """Writes a session: one event every 40 ms, each with its command, feedback, a picture and two packets of sound."""

    def __init__(self, path: Path, *, first_event: int = 1, events: int = 100, force_at: int = 0) -> None:
        self.path = path
        self.first_event = first_event
        self.events = events
        self.force_at = force_at  # index of the event with a contact; 0: none

    def entries(self) -> Iterator[Entry]:
        yield own_entry(RobotRecord(epoch=EPOCH, event=self.first_event, link="up", description=DESCRIPTION), START)
        yield own_entry(SeatRecord(epoch=EPOCH, event=self.first_event, holder="p1", name="Ada", why="request"), START)
        event, at = self.first_event, START
        yield from self.feedback(event, at, 0)
        for number in range(1, self.events):
            event, at = event_after(event), at + SECOND // 25
            yield own_entry(self.command(event, number), at - 10_000_000)
            yield from self.feedback(event, at, number)
            key = number % 50 == 1
            picture = (KEYFRAME if key else PICTURE) + number.to_bytes(4, "big")
            yield Entry(
                CAMERA + "front", event, at + 5_000_000, at + 1_000_000, camera_message("front", at, picture), key
            )
            for part in (0, 1):
                sound = b"opus" + number.to_bytes(4, "big") + bytes([part])
                moment = at + part * 20_000_000
                yield Entry(
                    MICROPHONE + "ear",
                    event,
                    moment + 6_000_000,
                    moment,
                    sound_message("opus", moment, sound, 48_000, 1),
                )

    def command(self, event: int, number: int) -> CommandRecord:
        return CommandRecord(
            epoch=EPOCH,
            event=event,
            issue=1,
            values=[number / self.events, 0.0],
            peer="p1",
            name="Ada",
            outcome="forwarded",
        )

    def feedback(self, event: int, at: int, number: int) -> Iterator[Entry]:
        force = 5.0 if number and number == self.force_at else 0.1
        record = FeedbackRecord(
            epoch=EPOCH,
            event=event,
            issue=1,
            time=100.0 + number * 0.04,
            axes=[number / self.events, 0.0],
            joints=[float(number), 0.0, 0.5],
            wrench=[force, 0.0, 0.0, 0.0, 0.0, 0.0],
            ranges=[1.0, 2.0, 3.0],
            at_rest=False,
            stop=StopState(),
        )
        yield own_entry(record, at, at - 2_000_000)
        yield from feedback_messages(DESCRIPTION, record, at, at - 2_000_000)

    def write(self, *, close: bool = True) -> RecordingWriter:
        writer = RecordingWriter(self.path, INFO, DESCRIPTION, {"front": "H264", "ear": "opus"})
        for entry in sorted(self.entries(), key=lambda entry: entry.arrived):
            writer.flush_if_due(entry.arrived)
            writer.write(entry)
        if close:
            writer.close()
        return writer
