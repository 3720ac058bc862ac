"""One picture of a camera, by event, as a JPEG."""

from fractions import Fraction
from typing import NamedTuple

import av

from lockstep.protocol.serial import is_newer
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.format.payload import RecordedPicture
from lockstep.server.recording.format.records import Degraded
from lockstep.server.recording.format.topics import CAMERA, OWN_TOPICS
from lockstep.server.recording.reading.pictures import RecordedPictures
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["PictureAt", "jpeg_of", "picture_at"]

MAX_PICTURES = 1500  # decoded for one: a minute at 25 Hz; the console makes a keyframe every few seconds
MAX_BYTES = 64 * 1024 * 1024
QUALITY = 5  # of mjpeg: 2 is the best, 31 the smallest
DEGRADED = OWN_TOPICS[Degraded]


class PictureAt(NamedTuple):
    stamp: int
    jpeg: bytes


def picture_at(reader: RecordingReader, camera: str, event: int, width: int) -> PictureAt | None:
    """Return the picture that belongs to `event`, by the rule of datasets: the first one with its stamp, or else the
    newest older one. None: there is none, or a picture that it builds on is missing.

    Args:
        width: pixels, at most

    Raises:
        RecordingError, OSError: the recording cannot be read.
    """
    stamps, pictures = _needed(reader, CAMERA + camera, event)
    if not pictures:
        return None
    decoder = RecordedPictures()
    found: av.VideoFrame | None = None
    try:
        for number, picture in enumerate(pictures):
            found = _newest(decoder.decode(picture, number), found)
        found = _newest(decoder.flush(), found)
    except (av.FFmpegError, ValueError) as error:
        raise RecordingDamaged(f"a picture of {camera} cannot be decoded: {error}") from error
    if found is None or found.pts != len(pictures) - 1:
        return None
    return PictureAt(stamps[-1], jpeg_of(found, width))


def _needed(reader: RecordingReader, topic: str, event: int) -> tuple[list[int], list[RecordedPicture]]:
    """Return the pictures from a keyframe up to the wanted one, and their stamps."""
    stamps: list[int] = []
    pictures: list[RecordedPicture] = []
    size = 0
    start = reader.index.keyframe_before(topic, event)
    if start is None:
        return stamps, pictures
    is_whole = False  # from a keyframe on nothing was left out
    for record in reader.records(start.event, event, {topic, DEGRADED}, decodable=True):
        if record.topic == DEGRADED:
            is_whole = False
            continue
        picture = record.picture
        if picture is None or is_newer(record.event, event):
            continue
        if not is_whole:
            stamps.clear()
            pictures.clear()
            is_whole = picture.keyframe
        if not is_whole:
            continue
        stamps.append(record.event)
        pictures.append(picture)
        size += len(picture.data)
        if record.event == event:
            break
        if len(pictures) > MAX_PICTURES or size > MAX_BYTES:
            raise RecordingDamaged(f"more than {MAX_PICTURES} pictures from a keyframe to event {event}")
    return stamps, pictures


def _newest(frames: list[av.VideoFrame], known: av.VideoFrame | None) -> av.VideoFrame | None:
    return frames[-1] if frames else known


def jpeg_of(frame: av.VideoFrame, width: int) -> bytes:
    """Return the picture, at most `width` pixels wide, as a JPEG."""
    wide = max(16, min(width, frame.width) & ~1)
    high = max(16, round(frame.height * wide / frame.width) & ~1)
    whole = frame.reformat(wide, high, format="yuvj420p", interpolation="AREA")
    encoder = av.CodecContext.create("mjpeg", "w")
    encoder.width, encoder.height, encoder.pix_fmt = wide, high, "yuvj420p"
    encoder.time_base = Fraction(1, 25)
    encoder.qmin = encoder.qmax = QUALITY
    whole.pts = 0
    return b"".join(bytes(packet) for packet in [*encoder.encode(whole), *encoder.encode(None)])
