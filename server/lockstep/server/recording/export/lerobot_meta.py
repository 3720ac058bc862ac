"""The metadata of a LeRobot dataset, version 3: info, statistics, tasks, episodes. No I/O."""

import json
from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa

from lockstep.protocol.serial import event_gap
from lockstep.server.recording.episodes.episode_filter import EpisodeFilter
from lockstep.server.recording.export.episode_commands import EpisodeCommands
from lockstep.server.recording.export.lerobot_layout import LayoutChoice
from lockstep.server.recording.format.records import Whole

__all__ = [
    "EVENTS",
    "RATE",
    "DatasetEpisode",
    "DatasetNotes",
    "EpisodePlace",
    "EventRange",
    "Statistics",
    "episodes_table",
    "file_of",
    "info_of",
    "merged_statistics",
    "picture_statistics",
    "place_of",
    "statistics_of",
    "tasks_table",
]

Array = npt.NDArray[Any]
Statistics = dict[str, Any]
Features = dict[str, dict[str, Any]]

CHUNKS = 1000  # files of a folder
DATA_MB, VIDEO_MB = 100, 200  # of a file, for programs that append
QUANTILES = (1, 10, 50, 90, 99)
RULE = (
    "A row is an event s: the state is feedback s, the action command s+1, the picture of each camera the first one "
    "stamped s, or else the newest older one of the same episode, at most `tolerance` events older."
)
EVENTS = "Each event of an episode is a row. fps is the median rate of the first episodes; lockstep.time is the truth."
RATE = (
    "Row k of an episode is the newest event that had been executed at k / fps after its first row, by the bridge's "
    "clock, as a whole; lockstep.age is how much older it is. Where none followed for 1 s there are no rows."
)


class EventRange(msgspec.Struct, frozen=True, kw_only=True):
    """Events of a recording."""

    recording: str
    epoch: str
    first_event: int
    last_event: int

    def shared(self, recording: str, epoch: str, first_event: int, last_event: int) -> range:
        """Return which of these events are among its own, by their distance from the first one.

        Last events do not count: they make no row.
        """
        if (self.recording, self.epoch) != (recording, epoch):
            return range(0)
        first = max(0, event_gap(self.first_event, first_event))
        return range(first, min(event_gap(last_event, first_event), event_gap(self.last_event, first_event)))


class DatasetEpisode(EventRange, frozen=True, kw_only=True):
    """Where an episode of the dataset comes from."""

    part: int
    episode: str  # id; "": the recording as a whole
    task: str
    outcome: str
    rows: int
    left_out: int  # events that are in no row because a picture was too old
    rate: float = 0.0  # Hz, by the median interval of its events; 0: not known
    recorded: tuple[str, ...] = ()  # ids of the recorded episodes that it was made of; empty: an earlier version, whole
    commands: EpisodeCommands | None = None  # None: not known, of an earlier version
    marks: tuple[tuple[Whole, str], ...] = ()  # event, words: what somebody marked in it


class DatasetNotes(msgspec.Struct, frozen=True, kw_only=True):
    """meta/lockstep.json: what LeRobot has no place for."""

    version: Literal[1, 2, 3] = 2  # 3: something was taken out, which earlier versions do not reckon with
    rule: str = RULE
    sampling: str = EVENTS
    has_rate: bool = False  # the dataset has a rate of its own, and an event may be in several rows
    tolerance: int  # events
    batches: int = 1  # number of files of each kind, those that are gone included
    gone: list[int] = []  # numbers of the files that were deleted, with the episodes in them
    taken_out: list[EventRange] = []  # what is kept of these events may come in again
    fps: int = 0  # of a dataset without an episode, that had a rate of its own; else meta/info.json says it
    cameras: list[str]  # in the order of `lockstep.stamp`
    topics: list[str] = []  # of the cameras in recordings, in the same order
    drivers: list[str] = []  # names of all that drove
    units: dict[str, str] = {}  # of the values in state and action, by name
    layout: LayoutChoice = LayoutChoice()
    only: EpisodeFilter = EpisodeFilter()  # which of the kept episodes it takes
    success: str = "lockstep.success: 1 success, 0 failure, -1 not said"
    intervention: str = (
        "lockstep.intervention: 1 where the driver was no policy, in an episode that a policy had driven before, else 0"
    )
    episodes: list[DatasetEpisode]
    without_rows: list[DatasetEpisode] = []  # kept episodes that are not in the dataset, since none of them is a row

    @property
    def files(self) -> Iterator[str]:
        """The names of the files of each kind, without suffixes, in the order of their rows. Whoever wrote the notes
        may have written any number: end at the first one that is not there."""
        gone = set(self.gone)
        return (file_of(batch) for batch in range(self.batches) if batch not in gone)


class EpisodePlace(NamedTuple):
    """One episode in the dataset."""

    task: str
    begin: int  # number of its first row
    end: int  # behind its last row
    statistics: dict[str, Statistics]
    batch: int  # number of the files that it is in: one of each kind and camera
    place: int  # number of its first row among those of the batch


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


def merged_statistics(parts: Sequence[Statistics]) -> Statistics:
    """Return the statistics of several parts together, as LeRobot merges them: quantiles are weighted means."""
    counts = np.array([part["count"][0] for part in parts], np.float64)
    taken = {name: np.array([part[name] for part in parts], np.float64) for name in parts[0] if name != "count"}
    weights = (counts / counts.sum()).reshape(-1, *[1] * (taken["mean"].ndim - 1))
    mean = (taken["mean"] * weights).sum(axis=0)
    variance = ((taken["std"] ** 2 + (taken["mean"] - mean) ** 2) * weights).sum(axis=0)
    found = {name: (values * weights).sum(axis=0).tolist() for name, values in taken.items()}
    own = {"min": taken["min"].min(axis=0), "max": taken["max"].max(axis=0), "mean": mean, "std": np.sqrt(variance)}
    return found | {name: value.tolist() for name, value in own.items()} | {"count": [int(counts.sum())]}


def file_of(batch: int) -> str:
    """Return the name of a batch's files, without a suffix."""
    chunk, file = place_of(batch)
    return f"chunk-{chunk:03d}/file-{file:03d}"


def place_of(batch: int) -> tuple[int, int]:
    """Return the numbers of a batch's folder, and of its files in it."""
    return divmod(batch, CHUNKS)


def tasks_table(tasks: Sequence[str]) -> pa.Table:
    """Return meta/tasks.parquet, with the tasks as the index of pandas, by which LeRobot looks them up."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_type, "metadata": None}
        for name, kind, numpy_type in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks)})
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def episodes_table(episodes: Sequence[EpisodePlace], first: int, fps: int, videos: list[str]) -> pa.Table:
    """Return meta/episodes/… of a batch: the place of each episode, from number `first` on, and its statistics."""
    rows = [_episode_row(number, each, fps, videos) for number, each in enumerate(episodes, first)]
    return pa.table({name: [row[name] for row in rows] for name in rows[0]})


def _episode_row(number: int, episode: EpisodePlace, fps: int, videos: list[str]) -> dict[str, Any]:
    chunk, file = place_of(episode.batch)
    length = episode.end - episode.begin
    row: dict[str, Any] = {
        "episode_index": number,
        "tasks": [episode.task],
        "length": length,
        "data/chunk_index": chunk,
        "data/file_index": file,
        "dataset_from_index": episode.begin,
        "dataset_to_index": episode.end,
    }
    for key in videos:
        row |= {
            f"videos/{key}/chunk_index": chunk,
            f"videos/{key}/file_index": file,
            f"videos/{key}/from_timestamp": episode.place / fps,
            f"videos/{key}/to_timestamp": (episode.place + length) / fps,
        }
    for feature, numbers in episode.statistics.items():
        row |= {f"stats/{feature}/{name}": value for name, value in numbers.items()}
    return row | {"meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file}
