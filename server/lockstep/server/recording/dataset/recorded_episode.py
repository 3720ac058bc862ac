"""Reads one episode of a LeRobot dataset, or of a recording, to be driven again. Blocks. Datasets need pyarrow."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from lockstep.server.recording.errors import DatasetRefused, RecordingDamaged
from lockstep.server.recording.export.lerobot_layout import layout_of
from lockstep.server.recording.export.lerobot_rows import episodes_now, rows_of, stretches_of
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.whole_recordings import whole_recordings

__all__ = ["RecordedEpisode", "episode_of_dataset", "episode_of_recording"]


class RecordedEpisode(NamedTuple):
    """Values by row, with their names."""

    times: list[float]  # s
    action_names: list[str]
    actions: list[list[float]]
    state_names: list[str]
    states: list[list[float]]
    units: dict[str, str]  # by name, where they are known
    task: str


def episode_of_dataset(root: Path, number: int) -> RecordedEpisode:
    """Read an episode of any LeRobot dataset of version 3; one that Lockstep has made says true times and units.

    Raises:
        DatasetRefused: there is no such episode.
        RecordingDamaged: it is no such dataset.
        OSError: a file cannot be read.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        info = json.loads((root / "meta" / "info.json").read_bytes())
        names = {key: _names(info["features"][key]) for key in ("action", "observation.state")}
        if not 0 <= number < info["total_episodes"]:
            raise DatasetRefused(f"there is no episode {number}; the dataset has {info['total_episodes']}")
        rows: list[dict[str, Any]] = []
        wanted = ["action", "observation.state", "timestamp", "task_index"]
        for path in sorted(root.glob("data/*/*.parquet")):
            own = [name for name in ("lockstep.time", "lockstep.age") if name in pq.read_schema(path).names]
            rows += pq.read_table(path, columns=[*wanted, *own], filters=[("episode_index", "=", number)]).to_pylist()
        tasks = pq.read_table(root / "meta" / "tasks.parquet").to_pylist()
        units = _units(root)
        times = [row.get("lockstep.time", row["timestamp"]) + row.get("lockstep.age", 0.0) for row in rows]
        task = next((str(each["task"]) for each in tasks if rows and each["task_index"] == rows[0]["task_index"]), "")
    except (ValueError, KeyError, TypeError, msgspec.DecodeError, pa.ArrowException) as error:
        raise RecordingDamaged(f"{root.name}: {error}") from error
    return RecordedEpisode(
        times=times,
        action_names=names["action"],
        actions=[_list(row["action"]) for row in rows],
        state_names=names["observation.state"],
        states=[_list(row["observation.state"]) for row in rows],
        units=units,
        task=task,
    )


def episode_of_recording(path: Path, number: int, *, whole: bool = False) -> RecordedEpisode:
    """Read a kept episode of a recording, counted from 0; one that was not made by episodes is one as a whole.

    Args:
        whole: a file without episodes is one as a whole, also where that is not certain

    Raises:
        DatasetRefused: there is no such episode.
        RecordingError, OSError: it cannot be read.
    """
    with RecordingReader(path) as reader:
        layout = layout_of(reader.description())
        episodes = episodes_now(reader)
        if not episodes and (why := whole_recordings([path], wanted=whole)[path]):
            raise DatasetRefused(f"{path.name} has no episodes, and {why}; --whole takes it as one all the same")
        stretches = stretches_of(reader, episodes, "")
        if not 0 <= number < len(stretches):
            raise DatasetRefused(f"there is no kept episode {number}; the recording has {len(stretches)}")
        (rows,) = rows_of(reader, layout, [stretches[number]], [], 0)
    return RecordedEpisode(
        times=[frame.time for frame in rows.frames],
        action_names=layout.names["action"],
        actions=[frame.action for frame in rows.frames],
        state_names=layout.names["observation.state"],
        states=[frame.state["observation.state"] for frame in rows.frames],
        units=layout.units,
        task=rows.stretch.task,
    )


def _names(feature: dict[str, Any]) -> list[str]:
    names = feature["names"]
    if isinstance(names, dict):  # older datasets: {"motors": […]}
        names = next(iter(names.values()))
    return [str(name) for name in names]


def _units(root: Path) -> dict[str, str]:
    path = root / "meta" / "lockstep.json"
    if not path.is_file():
        return {}
    return {str(name): str(unit) for name, unit in json.loads(path.read_bytes()).get("units", {}).items()}


def _list(values: float | Sequence[float]) -> list[float]:
    return [float(values)] if isinstance(values, int | float) else [float(value) for value in values]
