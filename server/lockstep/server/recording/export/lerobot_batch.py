"""Writes some episodes of a LeRobot dataset: one file of each kind and camera, and the metadata that counts them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.protocol.serial import event_gap
from lockstep.server.recording.errors import DatasetRefused
from lockstep.server.recording.export.lerobot_layout import DatasetLayout
from lockstep.server.recording.export.lerobot_meta import (
    DatasetEpisode,
    DatasetNotes,
    EpisodePlace,
    episodes_table,
    file_of,
    info_of,
    merged_statistics,
    picture_statistics,
    statistics_of,
    tasks_table,
)
from lockstep.server.recording.export.lerobot_rows import EpisodeRows
from lockstep.server.recording.export.lerobot_video import ExportedCamera, write_video

__all__ = [
    "METADATA",
    "DatasetState",
    "noted",
    "noted_without_rows",
    "write_batch",
    "write_metadata",
    "write_notes",
    "write_table",
]

Array = npt.NDArray[Any]
METADATA = ("meta/tasks.parquet", "meta/stats.json", "meta/lockstep.json", "meta/info.json")  # of all episodes
SUCCESS = {"success": 1, "failure": 0, "": -1}


class DatasetState(msgspec.Struct, kw_only=True):
    """What a dataset has; `write_batch` brings it up to date.

    Attributes:
        info, statistics: of meta/info.json and meta/stats.json; empty in a new dataset
    """

    robot: str
    fps: int
    notes: DatasetNotes
    tasks: list[str] = []
    info: dict[str, Any] = {}
    statistics: dict[str, Any] = {}


def write_batch(stage: Path, state: DatasetState, layout: DatasetLayout, episodes: Sequence[EpisodeRows]) -> list[str]:
    """Write the next episodes under `stage`, and the metadata with them.

    Returns:
        the files' paths in the dataset, in the order in which they may take their places: after each of them the
        dataset can be read, and has the new episodes, whole, from the last two on

    Raises:
        DatasetRefused: the episodes do not fit the dataset.
        RecordingError, OSError: they cannot be read, or not be written.
    """
    batch = state.notes.batches if state.info or state.notes.gone else 0
    state.tasks = list(dict.fromkeys([*state.tasks, *(each.stretch.task for each in episodes)]))
    cameras = _write_videos(stage, state, episodes, batch)
    parts = _columns_of_all(state, episodes)
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    features = _features(columns, cameras, state.notes, layout)
    if state.info and state.info["features"] != features:
        raise DatasetRefused("the episodes have other columns than the dataset")
    places = _places(episodes, parts, cameras, state.info.get("total_frames", 0), batch)
    data, episodes_file = f"data/{file_of(batch)}.parquet", f"meta/episodes/{file_of(batch)}.parquet"
    write_table(stage / data, pa.table({name: _arrow(values) for name, values in columns.items()}))
    count = state.info.get("total_episodes", 0)
    keys = [camera.key for camera in cameras]
    write_table(stage / episodes_file, episodes_table(places, count, state.fps, keys))
    frames = state.info.get("total_frames", 0) + sum(len(each.frames) for each in episodes)
    state.statistics = _all_statistics(state, places)
    state.info = info_of(state.robot, features, frames, state.fps, count + len(episodes), len(state.tasks))
    drivers = [frame.driver.name for each in episodes for frame in each.frames]
    state.notes = msgspec.structs.replace(
        state.notes,
        batches=batch + 1,
        drivers=list(dict.fromkeys([*state.notes.drivers, *drivers])),
        episodes=[*state.notes.episodes, *map(noted, episodes)],
        without_rows=_others(state.notes.without_rows, episodes),
    )
    write_metadata(stage, state)
    videos = [f"videos/{key}/{file_of(batch)}.mp4" for key in keys]
    *first, info = METADATA
    return [*videos, data, *first, episodes_file, info]


def write_metadata(stage: Path, state: DatasetState) -> None:
    """Write the files `METADATA` under `stage`. Raises OSError."""
    write_table(stage / "meta/tasks.parquet", tasks_table(state.tasks))
    _write_json(stage / "meta/stats.json", state.statistics)
    write_notes(stage, state.notes)
    _write_json(stage / "meta/info.json", state.info)


def noted_without_rows(notes: DatasetNotes, episodes: Sequence[EpisodeRows]) -> DatasetNotes:
    """Return the notes with these kept episodes, which have no row."""
    found = [*_others(notes.without_rows, episodes), *map(noted, episodes)]
    return msgspec.structs.replace(notes, without_rows=found)


def write_notes(stage: Path, notes: DatasetNotes) -> str:
    """Write meta/lockstep.json under `stage`, and return its path in the dataset. Raises OSError."""
    path = stage / "meta/lockstep.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(msgspec.json.format(msgspec.json.encode(notes)) + b"\n")
    return "meta/lockstep.json"


def _others(before: Sequence[DatasetEpisode], episodes: Sequence[EpisodeRows]) -> list[DatasetEpisode]:
    """Return those that are none of the episodes, trimmed or not, and share no event with one."""
    own = list(map(noted, episodes))
    ids = {(each.recording, each.part, each.episode) for each in own}
    return [
        each
        for each in before
        if (each.recording, each.part, each.episode) not in ids
        and not any(each.shared(new.recording, new.epoch, new.first_event, new.last_event) for new in own)
    ]


def _write_videos(
    stage: Path, state: DatasetState, episodes: Sequence[EpisodeRows], batch: int
) -> list[ExportedCamera]:
    found = []
    for key, topic in zip(state.notes.cameras, state.notes.topics, strict=True):
        known = state.info["features"][key]["shape"] if state.info else None
        size = None if known is None else (known[1], known[0])
        found.append(write_video(stage / f"videos/{key}/{file_of(batch)}.mp4", topic, list(episodes), state.fps, size))
    return found


def _columns_of_all(state: DatasetState, episodes: Sequence[EpisodeRows]) -> list[dict[str, Array]]:
    parts = []
    begin = state.info.get("total_frames", 0)
    for number, each in enumerate(episodes, state.info.get("total_episodes", 0)):
        parts.append(_columns(each, number, begin, state.fps, state.tasks.index(each.stretch.task)))
        begin += len(each.frames)
    return parts


def _columns(rows: EpisodeRows, number: int, begin: int, fps: int, task: int) -> dict[str, Array]:
    frames, count = rows.frames, len(rows.frames)
    columns: dict[str, Array] = {
        name: np.array([frame.state[name] for frame in frames], np.float32) for name in frames[0].state
    }
    columns["action"] = np.array([frame.action for frame in frames], np.float32)
    columns["lockstep.event"] = np.array([frame.event for frame in frames], np.int64)
    if rows.stamps:
        stamps = list(zip(*rows.stamps.values(), strict=True))
        gaps = [
            max(event_gap(frame.event, stamp) for stamp in each) for frame, each in zip(frames, stamps, strict=True)
        ]
        columns["lockstep.stamp"] = np.array(stamps, np.int64)
        columns["lockstep.gap"] = np.array(gaps, np.int64)
    return columns | {
        "lockstep.time": np.array([frame.time - frames[0].time for frame in frames], np.float64),
        "lockstep.age": np.array(rows.ages, np.float64),
        "lockstep.driver": np.array([frame.driver.name for frame in frames], object),
        "lockstep.driver_kind": np.array([frame.driver.kind for frame in frames], object),
        "lockstep.intervention": np.array([frame.driver.intervention for frame in frames], np.int64),
        "lockstep.success": np.full(count, SUCCESS[rows.stretch.outcome], np.int64),
        "timestamp": (np.arange(count) / fps).astype(np.float32),
        "frame_index": np.arange(count, dtype=np.int64),
        "episode_index": np.full(count, number, np.int64),
        "index": np.arange(begin, begin + count, dtype=np.int64),
        "task_index": np.full(count, task, np.int64),
    }


def _features(
    columns: dict[str, Array], cameras: list[ExportedCamera], notes: DatasetNotes, layout: DatasetLayout
) -> dict[str, Any]:
    names = {**layout.names, "lockstep.stamp": notes.cameras}
    features: dict[str, Any] = {camera.key: camera.feature for camera in cameras}
    for name, values in columns.items():
        dtype = "string" if values.dtype == object else str(values.dtype)
        features[name] = {"dtype": dtype, "shape": list(values.shape[1:]) or [1], "names": names.get(name)}
    return features


def _places(
    episodes: Sequence[EpisodeRows],
    parts: list[dict[str, Array]],
    cameras: list[ExportedCamera],
    begin: int,
    batch: int,
) -> list[EpisodePlace]:
    places, place = [], 0
    for number, (each, columns) in enumerate(zip(episodes, parts, strict=True)):
        statistics = {name: statistics_of(values) for name, values in columns.items() if values.dtype != object}
        statistics |= {camera.key: picture_statistics(camera.pixels[number]) for camera in cameras}
        start, length = begin + place, len(each.frames)
        places.append(EpisodePlace(each.stretch.task, start, start + length, statistics, batch, place))
        place += length
    return places


def _all_statistics(state: DatasetState, places: list[EpisodePlace]) -> dict[str, Any]:
    parts = [*([state.statistics] if state.statistics else []), *(place.statistics for place in places)]
    return {name: merged_statistics([part[name] for part in parts]) for name in parts[0]}


def noted(rows: EpisodeRows) -> DatasetEpisode:
    """Return what the dataset notes of an episode."""
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
        rate=round(rows.rate, 3),
        recorded=stretch.recorded,
        commands=rows.commands,
        marks=stretch.marks,
    )


def _arrow(values: Array) -> pa.Array:
    if values.dtype == object:
        return pa.array(values.tolist(), pa.string())
    if values.ndim == 1 or values.shape[1] == 1:  # LeRobot reads a feature of the shape (1,) as a plain number
        return pa.array(values.reshape(-1))
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])


def write_table(path: Path, table: pa.Table) -> None:
    """Write a table into a new file. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2) + "\n")
