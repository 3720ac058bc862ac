"""Recordings that tests make: a robot of two axes with a camera, a microphone and a force sensor."""

from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path

import av
import msgspec
import numpy as np

from lockstep.protocol.console import Report, StreamReport
from lockstep.protocol.description import (
    Axis,
    Camera,
    Joint,
    Microphone,
    PlanarBase,
    RangeRing,
    RobotDescription,
    WrenchSensor,
)
from lockstep.protocol.messages import StopState
from lockstep.protocol.serial import event_after
from lockstep.server.media.codecs.picture_encoder import create_picture_encoder
from lockstep.server.media.codecs.sound_encoder import Segment, create_sound_encoder
from lockstep.server.recording.format.foxglove import camera_message, command_messages, feedback_messages, sound_message
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import (
    CommandRecord,
    EpisodeRecord,
    FeedbackRecord,
    OwnRecord,
    ReportRecord,
    RobotRecord,
    SeatRecord,
)
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.format.topics import CAMERA, MICROPHONE, OWN_TOPICS, PICTURE_FORMATS, SOUND_FORMATS
from lockstep.server.recording.writing.writer import Entry, RecordingWriter

__all__ = ["CODECS", "DESCRIPTION", "EPOCH", "INFO", "SECOND", "START", "Story", "own_entry", "rewritten"]

EPOCH = "epoch-1"
SECOND = 1_000_000_000  # ns
START = 1_800_000_000 * SECOND
INFO = RecordingInfo(
    recording="20270115-planar-ab12", epoch=EPOCH, robot="Planar robot", name="first", by="Ada", episodes="none"
)
CODECS = {"front": "H264", "ear": "opus"}
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
INTERVAL = SECOND // 25
KEYFRAMES = 50  # events from one to the next


def own_entry(record: OwnRecord, at: int, captured: int | None = None) -> Entry:
    captured = at if captured is None else captured
    return Entry(OWN_TOPICS[type(record)], record.event, at, captured, msgspec.json.encode(record), record=record)


class Story:
    """A session: one event every 40 ms, each with its command, feedback, a picture and two packets of sound.

    Args:
        force_at: number of the event at which the robot touches something; 0: never
        stopped: numbers of the events whose feedback says that the robot is stopped
        real: pictures and sound that can be decoded; the pictures' brightness is 2 x the event
        codecs: of real pictures; the next one, over and over, with each keyframe
        sounds: codecs of real sound, a tone; the next one, over and over, with each keyframe
    """

    def __init__(
        self,
        *,
        first_event: int = 1,
        events: int = 100,
        force_at: int = 0,
        stopped: range = range(0),
        real: bool = False,
        codecs: tuple[str, ...] = ("H264",),
        sounds: tuple[str, ...] = ("opus",),
    ) -> None:
        self.first_event = first_event
        self.events = events
        self.force_at = force_at
        self.stopped = stopped
        self._codecs = codecs
        self._pictures = {codec: _real_pictures(codec) if real else _false_pictures for codec in codecs}
        self._heard = sounds
        self._sounds = {codec: _real_sounds(codec) if real else _false_sounds for codec in sounds}

    def entries(self) -> list[Entry]:
        """In the order of arrival."""
        return sorted(self._entries(), key=lambda entry: entry.arrived)

    def _entries(self) -> Iterator[Entry]:
        event, at = self.first_event, START
        codecs, sounds = cycle(self._codecs), cycle(self._heard)
        codec = heard = ""
        yield own_entry(RobotRecord(epoch=EPOCH, event=event, link="up", description=DESCRIPTION), START)
        yield own_entry(SeatRecord(epoch=EPOCH, event=event, holder="p1", name="Ada", why="request"), START)
        yield from self._feedback(event, at, 0)
        for number in range(1, self.events):
            event, at = event_after(event), at + INTERVAL
            command = self._command(event, number)
            yield own_entry(command, at - 10_000_000)
            yield from command_messages(DESCRIPTION, command, at - 10_000_000, at - 10_000_000)
            yield from self._feedback(event, at, number)
            key = number % KEYFRAMES == 1
            captured = at + 1_000_000
            codec, heard = (next(codecs), next(sounds)) if key else (codec, heard)
            picture = camera_message("front", captured, self._pictures[codec](number, key), PICTURE_FORMATS[codec])
            yield Entry(CAMERA + "front", event, at + 5_000_000, captured, picture, key)
            for part in (0, 1):
                moment = at + part * 20_000_000
                sound = sound_message(SOUND_FORMATS[heard], moment, self._sounds[heard](number, part))
                yield Entry(MICROPHONE + "ear", event, moment + 6_000_000, moment, sound)
            if number % 25 == 0:
                yield own_entry(self._report(event), at + 7_000_000)

    def _command(self, event: int, number: int) -> CommandRecord:
        return CommandRecord(
            epoch=EPOCH,
            event=event,
            issue=1,
            values=[number / self.events, 0.0],
            peer="p1",
            name="Ada",
            outcome="forwarded",
        )

    def _feedback(self, event: int, at: int, number: int) -> Iterator[Entry]:
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
            stop=StopState(stopped=number in self.stopped, by="Bo" if number in self.stopped else ""),
        )
        captured = at - 2_000_000
        yield own_entry(record, at, captured)
        yield from feedback_messages(DESCRIPTION, record, at, captured)

    def _report(self, event: int) -> ReportRecord:
        stream = StreamReport(
            stream="front", carrier="native", stamp=event, gap=1, max_gap=2, rendered=event, tolerance=4
        )
        return ReportRecord(
            epoch=EPOCH, event=event, peer="p1", name="Ada", report=Report(event=event, streams=[stream])
        )

    def write(self, path: Path, *, close: bool = True, signing: RecordingSigning | None = None) -> RecordingWriter:
        return _write(path, self.entries(), close=close, signing=signing)


def rewritten(
    path: Path,
    entries: list[Entry],
    change: Callable[[Entry], list[Entry]],
    description: RobotDescription = DESCRIPTION,
    info: RecordingInfo = INFO,
) -> Path:
    """A file with other records: `change` says what becomes of each. Its checksums and its index fit."""
    _write(path, [each for entry in entries for each in change(entry)], description=description, info=info)
    return path


def _write(
    path: Path,
    entries: list[Entry],
    *,
    close: bool = True,
    signing: RecordingSigning | None = None,
    description: RobotDescription = DESCRIPTION,
    info: RecordingInfo = INFO,
) -> RecordingWriter:
    writer = RecordingWriter(path, info, description, CODECS, signing)
    for entry in entries:
        writer.flush_if_due(entry.arrived)
        writer.write(entry)
    if close:
        writer.close("episodes" if any(isinstance(each.record, EpisodeRecord) for each in entries) else "no_episodes")
    return writer


def _false_pictures(number: int, key: bool) -> bytes:
    return (KEYFRAME if key else PICTURE) + number.to_bytes(4, "big")


def _false_sounds(number: int, part: int) -> bytes:
    return b"opus" + number.to_bytes(4, "big") + bytes([part])


def _real_pictures(codec: str) -> Callable[[int, bool], bytes]:
    encoder = create_picture_encoder(codec, 2_000_000, 25.0)

    def picture(number: int, key: bool) -> bytes:
        grey = np.full((240, 320, 3), min(250, 2 * (number + 1)), np.uint8)
        frame = av.VideoFrame.from_ndarray(grey, "rgb24").reformat(format="yuv420p")
        return encoder.encode(frame, number * 3600, key).data

    return picture


def _real_sounds(codec: str) -> Callable[[int, int], bytes]:
    encoder = create_sound_encoder(codec, 32_000, 0)
    rate = encoder.rate
    tone = (8000 * np.sin(np.arange(rate // 50) * 2 * np.pi * 400 / rate)).astype(np.int16)

    def sound(number: int, part: int) -> bytes:
        time = number * 0.04 + part * 0.02
        (packet,) = encoder.encode(Segment(tone, rate, 1, number + 1, time, time))
        return packet.data

    return sound
