"""Appends episodes to a LeRobot dataset that Lockstep has made. Blocks. Needs pyarrow."""

import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from lockstep.server.recording.dataset.commit import commit, recover, stage_of
from lockstep.server.recording.errors import DatasetRefused, RecordingDamaged
from lockstep.server.recording.export.lerobot_batch import DatasetState, noted_without_rows, write_batch, write_notes
from lockstep.server.recording.export.lerobot_layout import DatasetLayout
from lockstep.server.recording.export.lerobot_meta import DatasetNotes
from lockstep.server.recording.export.lerobot_rows import EpisodeRows
from lockstep.server.recording.export.unfinished import remove_stale

__all__ = ["alone_with", "append", "is_dataset", "note_without_rows", "notes_of_none", "read_state"]

_notes_decoder = msgspec.json.Decoder(DatasetNotes)
_json_decoder = msgspec.json.Decoder(dict[str, Any])


def is_dataset(root: Path) -> bool:
    """Return whether there is a dataset."""
    return (root / "meta" / "info.json").is_file()


@contextmanager
def alone_with(root: Path) -> Iterator[Path]:
    """Hold a dataset's lock, a file beside it, so that one process changes it.

    An interrupted append is completed, and what an interrupted removal has left beside the dataset is deleted.

    Yields:
        the file, which the holder may write

    Raises:
        DatasetRefused: another process appends to it.
        OSError: the lock or the dataset cannot be written.
    """
    root = root.resolve()  # one lock, whatever links lead here
    root.parent.mkdir(parents=True, exist_ok=True)
    lock = root.with_name(f".{root.name}.lock")
    number = os.open(lock, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise DatasetRefused(f"another process appends to {root.name}") from error
        recover(root)
        remove_stale(root.parent, root.name)
        yield lock
    finally:
        os.close(number)


def read_state(root: Path) -> DatasetState:
    """Read what a dataset has.

    Raises:
        RecordingDamaged: Lockstep has not made it, or it cannot be read.
        DatasetRefused: it was made by a version that had other columns.
        OSError: a file is missing.
    """
    try:
        notes = _notes_decoder.decode((root / "meta" / "lockstep.json").read_bytes())
        info = _json_decoder.decode((root / "meta" / "info.json").read_bytes())
        statistics = _json_decoder.decode((root / "meta" / "stats.json").read_bytes())
        tasks = pq.read_table(root / "meta" / "tasks.parquet").column("task").to_pylist()
        robot, fps = info["robot_type"], info["fps"]
    except (msgspec.DecodeError, pa.ArrowException, KeyError) as error:
        raise RecordingDamaged(f"{root.name}: {error}") from error
    if notes.version < 2:
        raise DatasetRefused(f"{root.name} was made by an earlier version: export its recordings anew")
    return DatasetState(robot=robot, fps=fps, notes=notes, tasks=tasks, info=info, statistics=statistics)


def notes_of_none(root: Path) -> DatasetNotes | None:
    """Return the notes of a dataset of which no episode is left; None: there is nothing.

    Raises:
        RecordingDamaged: there is something else, that a new dataset would get mixed with.
        OSError: it cannot be read.
    """
    path = root / "meta" / "lockstep.json"
    if is_dataset(root) or not path.exists():
        return None
    try:
        notes = _notes_decoder.decode(path.read_bytes())
    except msgspec.DecodeError as error:
        raise RecordingDamaged(f"{root.name}: {error}") from error
    if notes.episodes:
        raise RecordingDamaged(f"{root.name} has no meta/info.json, and files of a dataset")
    return notes


def append(root: Path, state: DatasetState, layout: DatasetLayout, episodes: Sequence[EpisodeRows]) -> None:
    """Append episodes, or make a new dataset of them; `alone_with` it. They are on the disk when this returns.

    Raises:
        DatasetRefused: they do not fit the dataset, which is as it was.
        RecordingError, OSError: they cannot be read or written; the dataset has none of them, or all.
    """
    commit(root, write_batch(stage_of(root), state, layout, episodes))


def note_without_rows(root: Path, state: DatasetState, episode: EpisodeRows) -> None:
    """Note in the dataset that a kept episode has no row; `alone_with` it. Raises OSError."""
    notes = noted_without_rows(state.notes, [episode])
    if notes != state.notes:
        commit(root, [write_notes(stage_of(root), notes)])
        state.notes = notes
