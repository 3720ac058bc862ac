"""`lockstep export --to lerobot`: a LeRobot dataset, version 3. Needs pyarrow.

The kept episodes of one or several recordings are its episodes; a recording in which no episode was ever begun is one
as a whole. `lerobot_rows` says what a row is. The rate is the median one of the events.
"""

import json
import os
import shutil
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.episodes.edits import edited, read_edits
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_meta import (
    FILE,
    DatasetEpisode,
    DatasetNotes,
    EpisodePlace,
    episodes_table,
    info_of,
    merged_statistics,
    picture_statistics,
    statistics_of,
    tasks_table,
)
from lockstep.server.recording.export.lerobot_rows import (
    EpisodeRows,
    check_same_robot,
    episodes_of,
    rows_of,
    state_names,
    state_of,
    stretches_of,
)
from lockstep.server.recording.export.lerobot_video import ExportedCamera, write_video
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["TOLERANCE", "export", "export_all"]

TOLERANCE = 4  # events, as the page's own

Array = npt.NDArray[Any]
SUCCESS = {"success": 1, "failure": 0, "": -1}


def export(path: Path, out: Path | None, task: str) -> list[Path]:
    """Write and return a new directory: `out`, or one beside `path`. Raises RecordingError, OSError."""
    return export_all([path], out, task)


def export_all(paths: Sequence[Path], out: Path | None, task: str, tolerance: int = TOLERANCE) -> list[Path]:
    """Write one dataset of the recordings, in their order. The directory appears when all of it is written.

    Args:
        out: a new directory; None: one beside the first recording
        task: of recordings without episodes, in words
        tolerance: events by which a picture may be older than its row

    Raises:
        RecordingError: a recording cannot be read, none has a row, or they are of different robots.
        OSError: the directory is there already, or cannot be written.
    """
    root = out or paths[0].with_suffix(".lerobot")
    if root.exists():
        raise FileExistsError(17, "it is there already", str(root))
    description, cameras, episodes = _read(paths, task, tolerance)
    partial = root.with_name(f".{root.name}.partial-{os.getpid()}")
    try:
        _write_dataset(partial, description, cameras, episodes, tolerance)
        partial.rename(root)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    return [root]


def _read(paths: Sequence[Path], task: str, tolerance: int) -> tuple[RobotDescription, list[str], list[EpisodeRows]]:
    """Return the robot, its cameras' topics, and the rows of all episodes that have some."""
    description: RobotDescription | None = None
    cameras: list[str] = []
    episodes: list[EpisodeRows] = []
    for path in paths:
        with RecordingReader(path) as reader:
            robot = reader.description()
            topics = [each.topic for each in reader.index.topics if reader.index.keyframes.get(each.topic)]
            if description is None:
                description, cameras = robot, topics
            check_same_robot(description, robot)
            if sorted(topics) != sorted(cameras):
                raise RecordingDamaged(f"{path.name} has other cameras than {paths[0].name}")
            stretches = stretches_of(reader, edited(episodes_of(reader), read_edits(path)), task)
            episodes += rows_of(reader, robot, stretches, cameras, tolerance)
    episodes = [each for each in episodes if each.frames]
    if description is None or not episodes:
        raise RecordingDamaged("no kept event has a feedback, a command that answers it, and a picture of every camera")
    return description, cameras, episodes


def _write_dataset(
    root: Path, description: RobotDescription, cameras: list[str], episodes: list[EpisodeRows], tolerance: int
) -> None:
    root.mkdir(parents=True)
    fps = _rate(episodes)
    exported = [write_video(root, topic, episodes, fps) for topic in cameras]
    tasks = list(dict.fromkeys(each.stretch.task for each in episodes))
    drivers = sorted({frame.driver for each in episodes for frame in each.frames})
    _write_tables(root, description, episodes, exported, fps, tasks, drivers)
    notes = DatasetNotes(
        tolerance=tolerance,
        cameras=[camera.key for camera in exported],
        drivers=drivers,
        episodes=[_noted(each) for each in episodes],
    )
    (root / "meta" / "lockstep.json").write_bytes(msgspec.json.format(msgspec.json.encode(notes)) + b"\n")


def _noted(rows: EpisodeRows) -> DatasetEpisode:
    stretch = rows.stretch
    return DatasetEpisode(
        recording=stretch.info.recording,
        part=stretch.info.part,
        epoch=stretch.info.epoch,
        episode=stretch.episode,
        first_event=stretch.first_event,
        last_event=stretch.last_event,
        task=stretch.task,
        outcome=stretch.outcome,
        rows=len(rows.frames),
        left_out=rows.left_out,
    )


def _rate(episodes: list[EpisodeRows]) -> int:
    """Return the events per second by the median interval, so that pauses do not count; at least 1 Hz.

    A dataset of this version has one rate for all its frames, in whole hertz.
    """
    intervals = [
        later.feedback.time - earlier.feedback.time
        for each in episodes
        for earlier, later in pairwise(each.frames)
        if later.feedback.time > earlier.feedback.time
    ]
    return max(1, round(1 / float(np.median(intervals)))) if intervals else 1


def _columns(rows: EpisodeRows, number: int, begin: int, fps: int, tasks: list[str], drivers: list[str]) -> Any:
    count = len(rows.frames)
    events = [frame.feedback.event for frame in rows.frames]
    columns: dict[str, Array] = {
        "observation.state": np.array([state_of(frame.feedback) for frame in rows.frames], np.float32),
        "action": np.array([frame.action for frame in rows.frames], np.float32),
        "lockstep.event": np.array(events, np.int64),
    }
    if rows.stamps:
        stamps = list(zip(*rows.stamps.values(), strict=True))
        gaps = [max(event_gap(event, stamp) for stamp in each) for event, each in zip(events, stamps, strict=True)]
        columns["lockstep.stamp"] = np.array(stamps, np.int64)
        columns["lockstep.gap"] = np.array(gaps, np.int64)
    columns |= {
        "lockstep.driver": np.array([drivers.index(frame.driver) for frame in rows.frames], np.int64),
        "lockstep.success": np.full(count, SUCCESS[rows.stretch.outcome], np.int64),
        "timestamp": (np.arange(count) / fps).astype(np.float32),
        "frame_index": np.arange(count, dtype=np.int64),
        "episode_index": np.full(count, number, np.int64),
        "index": np.arange(begin, begin + count, dtype=np.int64),
        "task_index": np.full(count, tasks.index(rows.stretch.task), np.int64),
    }
    return columns


def _write_tables(
    root: Path,
    description: RobotDescription,
    episodes: list[EpisodeRows],
    cameras: list[ExportedCamera],
    fps: int,
    tasks: list[str],
    drivers: list[str],
) -> None:
    parts: list[dict[str, Array]] = []
    places: list[EpisodePlace] = []
    begin = 0
    for number, each in enumerate(episodes):
        columns = _columns(each, number, begin, fps, tasks, drivers)
        statistics = {name: statistics_of(values) for name, values in columns.items()}
        statistics |= {camera.key: picture_statistics(camera.pixels[number]) for camera in cameras}
        parts.append(columns)
        places.append(EpisodePlace(each.stretch.task, begin, begin + len(each.frames), statistics))
        begin += len(each.frames)
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    names = {
        "observation.state": state_names(description),
        "action": [axis.name for axis in description.axes],
        "lockstep.stamp": [camera.key for camera in cameras],
    }
    features: dict[str, dict[str, Any]] = {camera.key: camera.feature for camera in cameras}
    for name, values in whole.items():
        shape = list(values.shape[1:]) or [1]
        features[name] = {"dtype": str(values.dtype), "shape": shape, "names": names.get(name)}
    keys = [camera.key for camera in cameras]
    _write(root / "data" / f"{FILE}.parquet", pa.table({name: _arrow(values) for name, values in whole.items()}))
    _write(root / "meta" / "tasks.parquet", tasks_table(tasks))
    _write(root / "meta" / "episodes" / f"{FILE}.parquet", episodes_table(places, fps, keys))
    statistics = {name: statistics_of(values) for name, values in whole.items()}
    statistics |= {camera.key: merged_statistics(camera.pixels) for camera in cameras}
    info = info_of(description.name, features, begin, fps, len(episodes), len(tasks))
    for name, content in (("info.json", info), ("stats.json", statistics)):
        (root / "meta" / name).write_text(json.dumps(content, indent=2) + "\n")


def _arrow(values: Array) -> pa.Array:
    if values.ndim == 1 or values.shape[1] == 1:  # LeRobot reads a feature of the shape (1,) as a plain number
        return pa.array(values.reshape(-1))
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])


def _write(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)
