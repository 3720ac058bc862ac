"""The metadata of a LeRobot dataset, version 3: info, statistics, tasks, episodes. No I/O."""

import json
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa

__all__ = [
    "FILE",
    "DatasetEpisode",
    "DatasetNotes",
    "EpisodePlace",
    "Statistics",
    "episodes_table",
    "info_of",
    "merged_statistics",
    "picture_statistics",
    "statistics_of",
    "tasks_table",
]

Array = npt.NDArray[Any]
Statistics = dict[str, Any]
Features = dict[str, dict[str, Any]]

FILE = "chunk-000/file-000"  # the only one of each kind
CHUNKS = 1000  # files of a folder
DATA_MB, VIDEO_MB = 100, 200  # of a file, for programs that append
QUANTILES = (1, 10, 50, 90, 99)
RULE = (
    "A row is an event s: the state is feedback s, the action command s+1, the picture of each camera the first one "
    "stamped s, or else the newest older one of the same episode, at most `tolerance` events older."
)


class DatasetEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """Where an episode of the dataset comes from."""

    recording: str
    part: int
    epoch: str
    episode: str  # id; "": the recording as a whole
    first_event: int
    last_event: int
    task: str
    outcome: str
    rows: int
    left_out: int  # events without a picture within the tolerance


class DatasetNotes(msgspec.Struct, frozen=True, kw_only=True):
    """meta/lockstep.json: what LeRobot has no place for."""

    version: Literal[1] = 1
    rule: str = RULE
    tolerance: int  # events
    cameras: list[str]  # in the order of `lockstep.stamp`
    drivers: list[str]  # names, by the number in `lockstep.driver`
    success: str = "lockstep.success: 1 success, 0 failure, -1 not said"
    episodes: list[DatasetEpisode]


class EpisodePlace(NamedTuple):
    """One episode in the dataset."""

    task: str
    begin: int  # number of its first row
    end: int  # behind its last row
    statistics: dict[str, Statistics]


def info_of(robot: str, features: Features, frames: int, fps: int, episodes: int, tasks: int) -> dict[str, Any]:
    """Return meta/info.json."""
    return {
        "codebase_version": "v3.0",
        "robot_type": robot,
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": CHUNKS,
        "data_files_size_in_mb": DATA_MB,
        "video_files_size_in_mb": VIDEO_MB,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        "features": features,
    }


def statistics_of(values: Array) -> Statistics:
    """Return the statistics of one feature, a row for each frame, as lists like in meta/stats.json."""
    table = np.asarray(values, np.float64)
    table = table[:, None] if table.ndim == 1 else table
    found: Statistics = {
        "min": table.min(axis=0).tolist(),
        "max": table.max(axis=0).tolist(),
        "mean": table.mean(axis=0).tolist(),
        "std": table.std(axis=0).tolist(),
        "count": [len(table)],
    }
    for percent in QUANTILES:
        found[f"q{percent:02d}"] = np.percentile(table, percent, axis=0).tolist()
    return found


def picture_statistics(pixels: Array) -> Statistics:
    """Return the statistics of pictures: `pixels` is N x 3 of 0 to 1; each number is 3 x 1 x 1."""
    found = statistics_of(pixels)
    return {name: value if name == "count" else np.reshape(value, (3, 1, 1)).tolist() for name, value in found.items()}


def merged_statistics(pixels: Sequence[Array]) -> Statistics:
    """Return the statistics of the pictures of all episodes."""
    return picture_statistics(np.concatenate(pixels))


def tasks_table(tasks: Sequence[str]) -> pa.Table:
    """Return meta/tasks.parquet, with the tasks as the index of pandas, by which LeRobot looks them up."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_type, "metadata": None}
        for name, kind, numpy_type in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks)})
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def episodes_table(episodes: Sequence[EpisodePlace], fps: int, videos: list[str]) -> pa.Table:
    """Return meta/episodes/…: the place of each episode, and its statistics."""
    rows = [_episode_row(number, each, fps, videos) for number, each in enumerate(episodes)]
    return pa.table({name: [row[name] for row in rows] for name in rows[0]})


def _episode_row(number: int, episode: EpisodePlace, fps: int, videos: list[str]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "episode_index": number,
        "tasks": [episode.task],
        "length": episode.end - episode.begin,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": episode.begin,
        "dataset_to_index": episode.end,
    }
    for key in videos:
        row |= {
            f"videos/{key}/chunk_index": 0,
            f"videos/{key}/file_index": 0,
            f"videos/{key}/from_timestamp": episode.begin / fps,
            f"videos/{key}/to_timestamp": episode.end / fps,
        }
    for feature, numbers in episode.statistics.items():
        row |= {f"stats/{feature}/{name}": value for name, value in numbers.items()}
    return row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
