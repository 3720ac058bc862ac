"""`lockstep export --to mp4`: one file for each camera, with sound. Pictures and Opus are copied, not encoded again.

Pictures are encoded anew, all in the largest size, only if their size changed or some are VP8, which MP4 does not hold.
"""

import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import av
from av.container import OutputContainer

from lockstep.protocol.serial import is_newer
from lockstep.server.recording.episodes.edits import edited, read_edits
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.export_sound import sound_writer
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.export.unfinished import unfinished_file
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.payload import SOUND, RecordedPicture, RecordedSound
from lockstep.server.recording.format.records import Degraded
from lockstep.server.recording.format.topics import CAMERA, OWN_TOPICS
from lockstep.server.recording.reading.episode_of_event import EpisodeOfEvent
from lockstep.server.recording.reading.pictures import RecordedPictures, picture_size
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.util.display_names import printable

if TYPE_CHECKING:
    from av.container.core import Chapter  # it is nowhere but in their types

__all__ = ["export"]

VIDEO_BASE = Fraction(1, 90_000)
SECOND = 1_000_000_000
MILLISECOND = 1_000_000
DEGRADED = OWN_TOPICS[Degraded]
MAX_TITLE = 250  # characters
MAX_CAMERA = 60  # characters of the camera's name in a file name


class Timed(NamedTuple):
    topic: str
    captured: int  # ns since 1970
    data: bytes
    picture: RecordedPicture | None
    sound: RecordedSound | None
    event: int  # its stamp


def export(path: Path, out: Path | None, task: str) -> list[Path]:
    """Write and return the files.

    Args:
        out: with one camera the file, else the directory; None: beside `path`

    Raises:
        RecordingError: the recording cannot be read, or has no pictures.
        OSError: a file cannot be written.
    """
    with RecordingReader(path) as reader:
        cameras = [each.topic for each in reader.index.topics if each.topic.startswith(CAMERA)]
        cameras = [topic for topic in cameras if reader.index.counts.get(topic)]
        if not cameras:
            raise RecordingDamaged("the recording has no pictures")
        sound = _first_sound(reader)
        episodes = edited(episodes_of(reader), read_edits(path))
        written = []
        for topic in cameras:
            target = _target(path, out, topic.removeprefix(CAMERA), len(cameras) == 1)
            while target in written:  # names that differ only in characters that file names lack
                target = target.with_stem(f"{target.stem}_")
            with unfinished_file(target) as partial:
                _write(reader, topic, sound, partial, episodes)
            written.append(target)
        return written


def _first_sound(reader: RecordingReader) -> str | None:
    """Return the topic of the first microphone with any sound, or None."""
    found = (each.topic for each in reader.index.topics if each.schema in SOUND)
    return next((topic for topic in found if reader.index.counts.get(topic)), None)


def _target(path: Path, out: Path | None, camera: str, only: bool) -> Path:
    if out is not None and only and out.suffix == ".mp4":
        return out
    # The camera's name comes from the robot, or from the maker of the file: it must not name a folder.
    name = re.sub(r"[^\w. -]", "_", camera)[:MAX_CAMERA]
    return (out or path.parent) / f"{path.stem}-{name}.mp4"


def _write(
    reader: RecordingReader, topic: str, sound: str | None, target: Path, episodes: Sequence[EpisodeEntry]
) -> None:
    keyframes = (each.picture for each in _timed(reader, topic) if each.picture is not None and each.picture.keyframe)
    kinds = {(each.format, size) for each in keyframes if (size := picture_size(each)) is not None}
    sizes = {size for _, size in kinds}
    first = next(_timed(reader, topic), None)
    if first is None or not sizes:
        raise RecordingDamaged(f"{topic}: there is no picture that can be decoded")
    packet = None if sound is None else next(_timed(reader, sound), None)
    heard = (each.sound for each in _timed(reader, sound) if each.sound is not None) if sound is not None else ()
    began = min(each.captured for each in (first, packet) if each is not None)
    with av.open(str(target), "w", format="mp4", options={"movflags": "+faststart"}) as output:
        copied = kinds == {("h264", *sizes)}
        video = _Copied(output, first.data) if copied else _Encoded(output, max(sizes))
        audio = sound_writer(output, heard)
        output.set_chapters(_chapters(reader, topic, episodes, began) if episodes else [])
        for each in _timed(reader, topic, *([] if sound is None else [sound])):
            if each.topic == topic:
                video.take(each, began)
            elif audio is not None and each.sound is not None:
                audio.take(each.sound, each.captured - began)
        video.close()
        if audio is not None:
            audio.close()


def _chapters(reader: RecordingReader, topic: str, episodes: Sequence[EpisodeEntry], began: int) -> "list[Chapter]":
    """Return a chapter for each episode that has a picture, and for what is between them: players know no gaps."""
    places = EpisodeOfEvent(episodes)
    begins: list[tuple[int, EpisodeEntry | None]] = []  # ns
    newest, ended = 0, began
    for each in _timed(reader, topic):
        newest = each.event if not newest or is_newer(each.event, newest) else newest
        episode = places.of(newest)
        if not begins or begins[-1][1] is not episode:
            begins.append((each.captured, episode))
        ended = each.captured
    times = [(begin - began) // MILLISECOND for begin, _ in begins]
    return [
        {
            "id": number,
            "start": times[number],
            "end": end,
            "time_base": Fraction(1, 1000),
            "metadata": {"title": "no episode" if episode is None else _title(episode)},
        }
        for number, ((_, episode), end) in enumerate(
            zip(begins, [*times[1:], (ended - began) // MILLISECOND + 1], strict=True)
        )
    ]


def _title(episode: EpisodeEntry) -> str:
    said = ", ".join(filter(None, (episode.state, episode.outcome, *episode.drivers)))
    return printable(f"{episode.number}: {episode.task} ({said})")[:MAX_TITLE]


class _Copied:
    """Writes pictures as they were recorded."""

    def __init__(self, output: OutputContainer, keyframe: bytes) -> None:
        self._output = output
        # A muxer needs an input stream as a template: here that of the first picture alone.
        with av.open(BytesIO(keyframe), format="h264") as first:
            self._stream = output.add_stream_from_template(first.streams.video[0])
        self._stream.time_base = VIDEO_BASE

    def take(self, each: Timed, began: int) -> None:
        packet = av.Packet(each.data)
        packet.stream, packet.time_base = self._stream, VIDEO_BASE
        packet.pts = packet.dts = round((each.captured - began) / SECOND / VIDEO_BASE)
        packet.is_keyframe = each.picture is not None and each.picture.keyframe
        self._output.mux(packet)

    def close(self) -> None: ...


class _Encoded:
    """Encodes pictures of different sizes or formats as one stream."""

    def __init__(self, output: OutputContainer, size: tuple[int, int]) -> None:
        self._output = output
        self._decoder = RecordedPictures()
        self._stream = output.add_stream("libx264", rate=25, options={"preset": "veryfast", "crf": "20"})
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = VIDEO_BASE

    def take(self, each: Timed, began: int) -> None:
        if each.picture is not None:
            self._encode(self._decoder.decode(each.picture, round((each.captured - began) / SECOND / VIDEO_BASE)))

    def close(self) -> None:
        self._encode(self._decoder.flush())
        self._output.mux(self._stream.encode(None))

    def _encode(self, frames: list[av.VideoFrame]) -> None:
        for frame in frames:
            whole = frame.reformat(self._stream.width, self._stream.height, interpolation="BILINEAR")
            whole.pts, whole.time_base = frame.pts, VIDEO_BASE
            self._output.mux(self._stream.encode(whole))


def _timed(reader: RecordingReader, *topics: str) -> Iterator[Timed]:
    """Yield the media in order of arrival, times of each topic increasing: pictures that can be decoded, from a
    keyframe on, also where the recorder has left something out."""
    newest: dict[str, int] = {}
    whole: set[str] = set()  # topics without a loss since their keyframe
    for record in reader.records(topics={*topics, DEGRADED}):
        if record.topic == DEGRADED:
            whole.clear()
            continue
        picture, sound = record.picture, record.sound
        medium = picture or sound
        if medium is None:
            continue
        if picture is None or picture.keyframe:
            whole.add(record.topic)
        if record.topic not in whole:
            continue
        captured = max(record.captured, newest.get(record.topic, 0) + MILLISECOND)
        newest[record.topic] = captured
        yield Timed(record.topic, captured, medium.data, picture, sound, record.event)
