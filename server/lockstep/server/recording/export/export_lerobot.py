"""`lockstep export --to lerobot`: a LeRobot dataset, version 3, of one episode. Needs pyarrow.

One frame is one event `s`: the state is feedback `s`, the action command `s+1`, which answered it, and each picture the
first one stamped `s`, or the newest older one. So a frame holds what belongs to the same state of the robot. Where
command `s+1` lets a goal axis stay, the action is the goal at which it stayed, by feedback `s+1`. The rate is the
median one of the events that were recorded.
"""

import json
import re
from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import av
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import is_newer
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_meta import (
    episode_table,
    info_of,
    picture_statistics,
    statistics_of,
    tasks_table,
)
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.reading.event_rows import WRENCH, event_rows
from lockstep.server.recording.reading.pictures import RecordedPictures
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["aligned", "export"]

FILE = "chunk-000/file-000"
SAMPLES = 200  # pictures of a camera for its statistics
PIXEL_STEP = 4  # between the pixels that are used, in both directions

Array = npt.NDArray[Any]


class Frame(NamedTuple):
    """One event: the state of the robot, and the command that answered it."""

    feedback: FeedbackRecord
    action: list[float]


class Picture(NamedTuple):
    stamp: int
    frame: av.VideoFrame


class ExportedCamera(NamedTuple):
    key: str  # "observation.images.front"
    feature: dict[str, Any]
    statistics: dict[str, Any]


def export(path: Path, out: Path | None, task: str) -> list[Path]:
    """Write and return a new directory: `out`, or one beside `path`. Raises RecordingError, OSError."""
    root = out or path.with_suffix(".lerobot")
    with RecordingReader(path) as reader:
        description = reader.description()
        cameras = [each.topic for each in reader.index.topics if reader.index.keyframes.get(each.topic)]
        first_stamps = [reader.index.keyframes[topic][0].event for topic in cameras]
        frames = [
            frame
            for frame in _frames(reader, description)
            if not any(is_newer(stamp, frame.feedback.event) for stamp in first_stamps)
        ]
        task = task or reader.info.name or "teleoperation"
    if not frames:
        raise RecordingDamaged("no event has a feedback, a command that answers it, and a picture of every camera")
    root.mkdir(parents=True)
    fps = _rate([frame.feedback.time for frame in frames])
    events = [frame.feedback.event for frame in frames]
    exported = [_write_video(path, root, topic, events, fps) for topic in cameras]
    _write_tables(root, description, frames, exported, fps, task)
    return [root]


def _rate(times: list[float]) -> int:
    """Return the events per second by the median interval, so that pauses do not count; at least 1 Hz.

    A dataset of this version has one rate for all its frames, in whole hertz.
    """
    intervals = [later - earlier for earlier, later in pairwise(times) if later > earlier]
    return max(1, round(1 / float(np.median(intervals)))) if intervals else 1


def _frames(reader: RecordingReader, description: RobotDescription) -> Iterator[Frame]:
    """Yield a frame for each event, but for those without an answer, as the last one, or with an incomplete state."""
    length = len(_state_names(description))
    for row, following in pairwise(event_rows(reader)):
        command = following.command
        action = None if command is None else _action(command, following.feedback)
        if action is not None and len(_state(row.feedback)) == length:
            yield Frame(row.feedback, action)


def _action(command: CommandRecord, answer: FeedbackRecord) -> list[float] | None:
    """Return the values of a command, and for a goal axis that is to stay its goal then; None if that is not known."""
    stays = answer.goals or [None] * len(command.values)
    values = [goal if value is None else value for value, goal in zip(command.values, stays, strict=False)]
    known = [value for value in values if value is not None]
    return known if len(known) == len(command.values) else None


def _state_names(description: RobotDescription) -> list[str]:
    names = [f"axis.{axis.name}" for axis in description.axes]
    names += [f"joint.{joint.name}" for joint in description.joints]
    names += [f"wrench.{name}" for name in WRENCH if description.wrench is not None]
    return names + [f"range.{number}" for number in range(description.ranges.count if description.ranges else 0)]


def _state(feedback: FeedbackRecord) -> list[float]:
    return [*feedback.axes, *feedback.joints, *feedback.wrench, *feedback.ranges]


def aligned(pictures: Iterable[Picture], events: Iterable[int]) -> Iterator[av.VideoFrame]:
    """Yield for each event the first picture with its stamp, or the newest older one. The first event must have one."""
    source = iter(pictures)
    current, upcoming = None, next(source, None)
    for event in events:
        while upcoming is not None and not is_newer(upcoming.stamp, event):
            if current is not None and current.stamp == event:
                break
            current, upcoming = upcoming, next(source, None)
        if current is None:
            raise RecordingDamaged(f"there is no picture for event {event}")
        yield current.frame


def _pictures(path: Path, topic: str) -> Iterator[Picture]:
    """Yield the decoded pictures, from the first keyframe on."""
    decoder = RecordedPictures()
    stamps: dict[int, int] = {}
    with RecordingReader(path) as reader:
        for number, record in enumerate(reader.records(topics={topic})):
            picture = record.picture
            if picture is None or (not stamps and not picture.keyframe):
                continue
            stamps[number] = record.event
            for frame in decoder.decode(picture, number):
                yield Picture(stamps.get(frame.pts or number, record.event), frame)
        for frame in decoder.flush():
            yield Picture(stamps.get(frame.pts or 0, 0), frame)


def _write_video(path: Path, root: Path, topic: str, events: list[int], fps: int) -> ExportedCamera:
    key = "observation.images." + re.sub(r"[^\w. -]", "_", topic.removeprefix(CAMERA))
    target = root / "videos" / key / f"{FILE}.mp4"
    target.parent.mkdir(parents=True)
    every = max(1, len(events) // SAMPLES)
    samples: list[Array] = []
    size = 0, 0
    with av.open(str(target), "w") as output:
        # A keyframe every second picture: training reads frames in any order.
        stream = output.add_stream("libx264", rate=fps, options={"crf": "23", "preset": "veryfast", "g": "2"})
        stream.pix_fmt = "yuv420p"
        for number, picture in enumerate(aligned(_pictures(path, topic), events)):
            if number == 0:
                size = picture.width, picture.height
                stream.width, stream.height = size
            whole = picture.reformat(*size, format="yuv420p")
            whole.pts, whole.time_base = number, Fraction(1, fps)
            output.mux(stream.encode(whole))
            if number % every == 0:
                samples.append(picture.to_ndarray(format="rgb24")[::PIXEL_STEP, ::PIXEL_STEP].reshape(-1, 3) / 255.0)
        output.mux(stream.encode(None))
    width, height = size
    feature = {
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
    statistics = picture_statistics(np.concatenate(samples))
    statistics["count"] = [len(samples)]
    return ExportedCamera(key, feature, statistics)


def _write_tables(
    root: Path, description: RobotDescription, frames: list[Frame], cameras: list[ExportedCamera], fps: int, task: str
) -> None:
    count = len(frames)
    columns: dict[str, Array] = {
        "observation.state": np.array([_state(frame.feedback) for frame in frames], np.float32),
        "action": np.array([frame.action for frame in frames], np.float32),
        "lockstep.event": np.array([frame.feedback.event for frame in frames], np.int64),
        "timestamp": (np.arange(count) / fps).astype(np.float32),
        "frame_index": np.arange(count, dtype=np.int64),
        "episode_index": np.zeros(count, np.int64),
        "index": np.arange(count, dtype=np.int64),
        "task_index": np.zeros(count, np.int64),
    }
    names = {"observation.state": _state_names(description), "action": [axis.name for axis in description.axes]}
    features: dict[str, dict[str, Any]] = {camera.key: camera.feature for camera in cameras}
    statistics = {camera.key: camera.statistics for camera in cameras}
    for name, values in columns.items():
        shape = list(values.shape[1:]) or [1]
        features[name] = {"dtype": str(values.dtype), "shape": shape, "names": names.get(name)}
        statistics[name] = statistics_of(values)
    data = pa.table({name: _arrow(values) for name, values in columns.items()})
    keys = [camera.key for camera in cameras]
    _write(root / "data" / f"{FILE}.parquet", data)
    _write(root / "meta" / "tasks.parquet", tasks_table(task))
    _write(root / "meta" / "episodes" / f"{FILE}.parquet", episode_table(task, count, fps, keys, statistics))
    info = info_of(description.name, features, count, fps)
    for name, content in (("info.json", info), ("stats.json", statistics)):
        (root / "meta" / name).write_text(json.dumps(content, indent=2) + "\n")


def _arrow(values: Array) -> pa.Array:
    if values.ndim == 1 or values.shape[1] == 1:  # LeRobot reads a feature of the shape (1,) as a plain number
        return pa.array(values.reshape(-1))
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])


def _write(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)
