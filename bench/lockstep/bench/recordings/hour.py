"""Makes a recording of any length without a session: `python -m lockstep.bench.recordings.hour FILE [SECONDS]`.

The records are those of a driven robot: 25 events a second with command, feedback and joints, two cameras with 15
pictures a second of 4 kB, 50 packets of sound. The contents of the pictures do not affect the time to open a file and
to seek in it.
"""

import os
import sys
from collections.abc import Iterator
from heapq import merge
from pathlib import Path

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.server.recording.format.foxglove import camera_message, feedback_messages, sound_message
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord, OwnRecord, RobotRecord, SeatRecord
from lockstep.server.recording.format.topics import CAMERA, MICROPHONE, OWN_TOPICS
from lockstep.server.recording.writing.writer import Entry, RecordingWriter

__all__ = ["make_recording"]

SECOND = 1_000_000_000
START = 1_800_000_000 * SECOND
EPOCH = "made"
RATE, PICTURE_RATE, SOUND_RATE = 25, 15, 50  # Hz
PICTURE_BYTES, KEYFRAME_BYTES, SOUND_BYTES = 4000, 20_000, 80
KEYFRAME_EVERY = 60  # pictures


def make_recording(path: Path, seconds: int) -> None:
    """Write a recording of `seconds` to `path`.

    Raises:
        DiskTrouble: the recording cannot be written.
    """
    description = create_robot("planar").describe()
    cameras = [camera.name for camera in description.cameras[:2]]
    codecs = {**dict.fromkeys(cameras, "H264"), **{each.name: "opus" for each in description.microphones[:1]}}
    info = RecordingInfo(recording=path.stem, epoch=EPOCH, robot=description.label)
    writer = RecordingWriter(path, info, description, codecs)
    sources = [
        _events(description, seconds),
        *(_pictures(camera, seconds) for camera in cameras),
        *(_sounds(each.name, seconds) for each in description.microphones[:1]),
    ]
    for entry in merge(*sources, key=lambda entry: entry.arrived):
        writer.write(entry)
        writer.flush_if_due(entry.arrived)
    writer.close()


def _own(record: OwnRecord, at: int) -> Entry:
    return Entry(OWN_TOPICS[type(record)], record.event, at, at, msgspec.json.encode(record), record=record)


def _events(description: RobotDescription, seconds: int) -> Iterator[Entry]:
    yield _own(RobotRecord(epoch=EPOCH, event=1, link="up", description=description), START)
    yield _own(SeatRecord(epoch=EPOCH, event=1, holder="p", name="Ada"), START)
    axes = [0.1] * len(description.axes)
    for number in range(seconds * RATE):
        event, at = number + 1, START + number * SECOND // RATE
        if number:
            command = CommandRecord(
                epoch=EPOCH, event=event, issue=1, values=[*axes], peer="p", name="Ada", outcome="forwarded"
            )
            yield _own(command, at - 10_000_000)
        feedback = FeedbackRecord(
            epoch=EPOCH,
            event=event,
            issue=1,
            time=number / RATE,
            axes=axes,
            joints=[number / 1000] * len(description.joints),
        )
        yield _own(feedback, at)
        yield from feedback_messages(description, feedback, at, at)


def _pictures(camera: str, seconds: int) -> Iterator[Entry]:
    noise = os.urandom(KEYFRAME_BYTES)
    for number in range(seconds * PICTURE_RATE):
        at = START + number * SECOND // PICTURE_RATE + 3_000_000
        key = number % KEYFRAME_EVERY == 0
        data = b"\0\0\0\1\x65" + noise if key else b"\0\0\0\1\x41" + noise[:PICTURE_BYTES]
        yield Entry(CAMERA + camera, _event_at(at), at, at, camera_message(camera, at, data), key)


def _sounds(microphone: str, seconds: int) -> Iterator[Entry]:
    noise = os.urandom(SOUND_BYTES)
    for number in range(seconds * SOUND_RATE):
        at = START + number * SECOND // SOUND_RATE + 2_000_000
        data = sound_message("opus", at, noise)
        yield Entry(MICROPHONE + microphone, _event_at(at), at, at, data)


def _event_at(time: int) -> int:
    return (time - START) * RATE // SECOND + 1


if __name__ == "__main__":
    make_recording(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 3600)
