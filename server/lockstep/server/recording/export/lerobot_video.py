"""The video of a camera in a LeRobot dataset: one picture for each row, encoded anew, some episodes into one file."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import av
import numpy as np
import numpy.typing as npt

from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_rows import EpisodeRows, Stretch, aligned_stamps, picture_records
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.reading.pictures import RecordedPictures
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["ExportedCamera", "camera_key", "copy_pictures", "write_video"]

SAMPLES = 200  # pictures of a camera and an episode for its statistics
PIXEL_STEP = 4  # between the pixels that are used, in both directions
# A keyframe every second picture, since training reads pictures in any order. One thread: somebody may be driving.
OPTIONS = {"crf": "23", "preset": "veryfast", "g": "2", "bf": "0", "threads": "1"}
AGAIN = OPTIONS | {"crf": "17"}  # for pictures that were encoded like that before: nothing is lost that one could see

Array = npt.NDArray[Any]


class ExportedCamera(NamedTuple):
    key: str  # "observation.images.front"
    feature: dict[str, Any]
    pixels: list[Array]  # of each episode, N x 3


def _pictures(stretch: Stretch, topic: str, events: list[int]) -> Iterator[av.VideoFrame]:
    """Yield the decoded picture of each event."""
    with RecordingReader(stretch.path) as reader:
        stamps = [record.event for record in picture_records(reader, topic, stretch)]
        wanted = [place for place, _ in aligned_stamps(stamps, events)]
        decoded = _decoded(reader, topic, stretch)
        number, frame = next(decoded, (-1, None))
        for place in wanted:
            while frame is not None and number < place:
                number, frame = next(decoded, (-1, None))
            if frame is None or number != place:
                raise RecordingDamaged(f"{topic}: a picture cannot be decoded")
            yield frame


def _decoded(reader: RecordingReader, topic: str, stretch: Stretch) -> Iterator[tuple[int, av.VideoFrame]]:
    """Yield the decoded pictures with their places among `picture_records`."""
    decoder = RecordedPictures()
    for place, record in enumerate(picture_records(reader, topic, stretch)):
        picture = record.picture
        if picture is not None:
            for frame in decoder.decode(picture, place):
                yield frame.pts or 0, frame
    for frame in decoder.flush():
        yield frame.pts or 0, frame


def camera_key(topic: str) -> str:
    """Return the name of a camera's column."""
    return "observation.images." + re.sub(r"[^\w. -]", "_", topic.removeprefix(CAMERA))


def write_video(
    target: Path, topic: str, episodes: list[EpisodeRows], fps: int, size: tuple[int, int] | None = None
) -> ExportedCamera:
    """Write the pictures of a camera, one for each row of the episodes, into one file.

    Args:
        size: pixels, width and height of the dataset's pictures; None: those of the first one
    """
    pixels: list[Array] = []
    with _video_file(target, fps, OPTIONS) as write:
        for each in episodes:
            events = [frame.event for frame in each.frames]
            every = max(1, len(events) // SAMPLES)
            samples: list[Array] = []
            for place, picture in enumerate(_pictures(each.stretch, topic, events)):
                size = size or (picture.width, picture.height)
                write(picture.reformat(*size, format="yuv420p"))
                if place % every == 0:
                    shown = picture.to_ndarray(format="rgb24")[::PIXEL_STEP, ::PIXEL_STEP]
                    samples.append(shown.reshape(-1, 3) / 255.0)
            pixels.append(np.concatenate(samples))
    if size is None:
        raise RecordingDamaged(f"{topic} has no picture")
    return ExportedCamera(camera_key(topic), _feature(*size, fps), pixels)


def copy_pictures(source: Path, target: Path, wanted: Sequence[range], fps: int) -> None:
    """Write some pictures of a dataset's file into a new one.

    Args:
        wanted: their places in the source, in its order

    Raises:
        RecordingDamaged: the source has not all of them.
    """
    places = (place for each in wanted for place in each)
    with av.open(str(source)) as video, _video_file(target, fps, AGAIN) as write:
        pictures = enumerate(video.decode(video=0))
        for place in places:
            found = next((picture for number, picture in pictures if number == place), None)
            if found is None:
                raise RecordingDamaged(f"{source.name} has no picture {place}")
            write(found)


@contextmanager
def _video_file(target: Path, fps: int, options: dict[str, str]) -> Iterator[Callable[[av.VideoFrame], None]]:
    """Give what writes the next picture, in YUV 4:2:0 and of the size of the first one."""
    target.parent.mkdir(parents=True, exist_ok=True)
    numbers = count()
    with av.open(str(target), "w") as output:
        stream = output.add_stream("libx264", rate=fps, options=options)
        stream.pix_fmt = "yuv420p"

        def write(picture: av.VideoFrame) -> None:
            number = next(numbers)
            if number == 0:
                stream.width, stream.height = picture.width, picture.height
            picture.pts, picture.time_base = number, Fraction(1, fps)
            output.mux(stream.encode(picture))

        yield write
        output.mux(stream.encode(None))


def _feature(width: int, height: int, fps: int) -> dict[str, Any]:
    return {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": fps,
            "video.channels": 3,
            "has_audio": False,
        },
    }
