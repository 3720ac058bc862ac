"""The metadata of a LeRobot dataset, version 3: info, statistics, tasks, episodes. No I/O."""

import json
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

__all__ = ["Statistics", "episode_table", "info_of", "statistics_of", "tasks_table"]

Array = npt.NDArray[Any]
Statistics = dict[str, Any]
Features = dict[str, dict[str, Any]]

CHUNKS = 1000  # files of a folder
DATA_MB, VIDEO_MB = 100, 200  # of a file, for programs that append
QUANTILES = (1, 10, 50, 90, 99)


def info_of(robot: str, features: Features, frames: int, fps: int) -> dict[str, Any]:
    """Return meta/info.json."""
    return {
        "codebase_version": "v3.0",
        "robot_type": robot,
        "total_episodes": 1,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": CHUNKS,
        "data_files_size_in_mb": DATA_MB,
        "video_files_size_in_mb": VIDEO_MB,
        "fps": fps,
        "splits": {"train": "0:1"},
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


def tasks_table(task: str) -> pa.Table:
    """Return meta/tasks.parquet, with the tasks as the index of pandas, by which LeRobot looks them up."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_type, "metadata": None}
        for name, kind, numpy_type in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    table = pa.table({"task_index": pa.array([0], pa.int64()), "task": pa.array([task])})
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def episode_table(task: str, frames: int, fps: int, videos: list[str], statistics: dict[str, Statistics]) -> pa.Table:
    """Return meta/episodes/…: the place of the one episode, and its statistics."""
    row: dict[str, Any] = {
        "episode_index": 0,
        "tasks": [task],
        "length": frames,
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": 0,
        "dataset_to_index": frames,
    }
    for key in videos:
        row |= {
            f"videos/{key}/chunk_index": 0,
            f"videos/{key}/file_index": 0,
            f"videos/{key}/from_timestamp": 0.0,
            f"videos/{key}/to_timestamp": frames / fps,
        }
    for feature, numbers in statistics.items():
        row |= {f"stats/{feature}/{name}": value for name, value in numbers.items()}
    row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
    return pa.table({name: [value] for name, value in row.items()})
