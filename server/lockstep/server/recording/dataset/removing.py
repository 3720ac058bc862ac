"""Takes episodes out of a LeRobot dataset that Lockstep has made. Blocks. Needs pyarrow.

A new folder is made beside the dataset, of hard links where nothing changes, and exchanged with it: who reads finds the
dataset before or after, and a process that ends at any moment leaves one of them. A file whose episodes all go is gone,
and no other file takes its number. Where some stay, they are written into a new file, and come last: so what a program
read before about a file holds as long as the file is there.
"""

import errno
import os
import shutil
from collections.abc import Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import av
import msgspec
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from lockstep.server.recording.dataset.commit import commit, stage_of
from lockstep.server.recording.dataset.exchange import exchanged, raised
from lockstep.server.recording.errors import DatasetRefused, RecordingDamaged
from lockstep.server.recording.export.lerobot_batch import (
    METADATA,
    DatasetState,
    write_metadata,
    write_notes,
    write_table,
)
from lockstep.server.recording.export.lerobot_meta import (
    DatasetEpisode,
    DatasetNotes,
    EventRange,
    file_of,
    merged_statistics,
    place_of,
    statistics_of,
)
from lockstep.server.recording.export.lerobot_video import copy_pictures

__all__ = ["Removed", "event_range", "remove"]

Row = dict[str, Any]
STATISTICS = "stats/"
MALFORMED = (KeyError, IndexError, TypeError, ValueError, FileNotFoundError)  # what damaged metadata raise
WITHOUT_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.EMLINK)  # of the file system, of this kind of file, any more
NUMBERED = ("index", "episode_index", "task_index")  # columns that say a place in the dataset


class _File(NamedTuple):
    """A file of each kind.

    Attributes:
        name, number: the new ones
        source: its name before
        places: of its episodes that stay, as they were before
    """

    name: str
    number: int
    source: str
    places: list[Row]
    is_whole: bool  # all its episodes stay


class Removed(NamedTuple):
    """
    Attributes:
        state: of what is left; None: no episode is
        notes: of the dataset, also where no episode is left
        episodes: that were taken out
    """

    state: DatasetState | None
    notes: DatasetNotes
    episodes: list[DatasetEpisode]


def remove(root: Path, state: DatasetState, discarded: Sequence[EventRange]) -> Removed:
    """Take out all episodes that have discarded events; `alone_with` it.

    Files that others have put into the folder stay. Where no episode is left, the notes do, for a dataset that begins
    anew (`notes_of_none`).

    Raises:
        DatasetRefused: the file system exchanges no folders, or the dataset is not all in one. The dataset is as it
            was, as after each error.
        RecordingDamaged: it cannot be read.
        OSError: it cannot be written.
    """
    root, notes = root.resolve(), state.notes
    out = [number for number, each in enumerate(notes.episodes) if _is_any(each, discarded)]
    without = [each for each in notes.without_rows if not _is_any(each, discarded)]
    notes = msgspec.structs.replace(notes, without_rows=without)
    taken = [notes.episodes[number] for number in out]
    if not out:
        if without != state.notes.without_rows:
            commit(root, [write_notes(stage_of(root), notes)])
        return Removed(msgspec.structs.replace(state, notes=notes), notes, taken)
    _check(root, notes)
    matched = [each for each in discarded if any(_is_any(one, [each]) for one in taken)]
    ranges = [event_range(each.recording, each.epoch, each.first_event, each.last_event) for each in taken]
    notes = msgspec.structs.replace(
        notes, version=3, taken_out=list(dict.fromkeys([*notes.taken_out, *ranges, *matched]))
    )
    before = msgspec.structs.replace(state, notes=notes)
    try:
        files = _files(root, notes, out)
        with exchanged(root, lambda new: _link_others(root, new, notes)) as new:
            made = _Removal(root, new, before, files).state if files else _none_left(before)
            write_notes(new, made.notes)
    except (pa.ArrowException, av.FFmpegError, ArithmeticError, AttributeError, *MALFORMED) as error:
        if isinstance(error, OSError) and not isinstance(error, FileNotFoundError):  # of FFmpeg: the disk is full
            raise
        raise RecordingDamaged(f"{root.name}: {error}") from error
    return Removed(made if files else None, made.notes, taken)


def event_range(recording: str, epoch: str, first_event: int, last_event: int) -> EventRange:
    """Return the range of these events."""
    return EventRange(recording=recording, epoch=epoch, first_event=first_event, last_event=last_event)


def _is_any(noted: DatasetEpisode, discarded: Sequence[EventRange]) -> bool:
    events = noted.recording, noted.epoch, noted.first_event, noted.last_event
    return any(each.shared(*events) for each in discarded)


def _none_left(state: DatasetState) -> DatasetState:
    """Return the state of a dataset without episodes: its notes alone."""
    notes = msgspec.structs.replace(
        state.notes,
        gone=list(range(state.notes.batches)),
        drivers=[],
        episodes=[],
        fps=state.fps if state.notes.has_rate else 0,
    )
    return msgspec.structs.replace(state, notes=notes)


def _check(root: Path, notes: DatasetNotes) -> None:
    """Raise DatasetRefused where a file of the dataset could be elsewhere: it would be changed there, or stay."""
    if any("/" in key or "\0" in key or key in ("", ".", "..") for key in notes.cameras):
        raise DatasetRefused(f"{root.name} names a camera in a way that Lockstep does not")
    for kind in ("data", "meta", "videos"):
        for folder, names, _ in os.walk(root / kind):
            links = [name for name in (".", *names) if (Path(folder) / name).is_symlink()]
            if links or (root / kind).is_symlink():
                raise DatasetRefused(f"{folder} is, or has, a link to a folder elsewhere")


def _files(root: Path, notes: DatasetNotes, numbers: Collection[int]) -> list[_File]:
    """Return the files that the dataset is to have, in the order of their rows."""
    whole: list[_File] = []
    parts: list[_File] = []
    for number in range(notes.batches):
        if number in notes.gone:
            continue
        source = file_of(number)
        before: list[Row] = pq.read_table(root / "meta/episodes" / f"{source}.parquet").to_pylist()
        places = [place for place in before if place["episode_index"] not in numbers]
        if len(places) == len(before):
            whole.append(_File(source, number, source, places, True))
        elif places:
            new = notes.batches + len(parts)
            parts.append(_File(file_of(new), new, source, places, False))
    return whole + parts


class _Removal:
    """Fills the new folder.

    Attributes:
        state: of the dataset there
    """

    def __init__(self, root: Path, new: Path, state: DatasetState, files: Sequence[_File]) -> None:
        self._root, self._new, self._before = root, new, state
        self._tasks = list(dict.fromkeys(place["tasks"][0] for file in files for place in file.places))
        self._episode = self._row = 0  # numbers of the next ones
        self._drivers: dict[str, None] = {}
        self._parts: list[dict[str, Any]] = []  # statistics of each episode
        for file in files:
            self._write(file)
        self.state = self._new_state(files)
        write_metadata(new, self.state)

    def _write(self, file: _File) -> None:
        old = self._root / f"data/{file.source}.parquet"
        before = pq.read_table(old)
        table = self._renumbered(before, file.places)
        self._drivers |= dict.fromkeys(table["lockstep.driver"].to_pylist())
        places = self._new_places(file, table)
        if table.equals(before):
            _link(old, self._new / f"data/{file.name}.parquet")
        else:
            write_table(self._new / f"data/{file.name}.parquet", table)
        write_table(self._new / f"meta/episodes/{file.name}.parquet", _table_of(places))
        for key in self._before.notes.cameras:
            source, target = (folder / f"videos/{key}" for folder in (self._root, self._new))
            if file.is_whole:
                _link(source / f"{file.source}.mp4", target / f"{file.name}.mp4")
            else:
                wanted = [_pictures(place, key, self._before.fps) for place in file.places]
                copy_pictures(source / f"{file.source}.mp4", target / f"{file.name}.mp4", wanted, self._before.fps)

    def _renumbered(self, table: pa.Table, places: Sequence[Row]) -> pa.Table:
        """Return the rows of these episodes, with the numbers that they are to have."""
        kept = pa.array([place["episode_index"] for place in places], pa.int64())
        table = table.filter(pc.is_in(table["episode_index"], value_set=kept))
        lengths = [place["length"] for place in places]
        if table.num_rows != sum(lengths):
            raise RecordingDamaged(f"{self._root.name} has {table.num_rows} rows where {sum(lengths)} are said")
        tasks = [self._tasks.index(place["tasks"][0]) for place in places]
        new = {
            "index": range(self._row, self._row + table.num_rows),
            "episode_index": _repeated(range(self._episode, self._episode + len(places)), lengths),
            "task_index": _repeated(tasks, lengths),
        }
        for name, values in new.items():
            table = table.set_column(table.schema.get_field_index(name), name, pa.array(values, pa.int64()))
        return table

    def _new_places(self, file: _File, table: pa.Table) -> list[Row]:
        found, begin, fps = [], 0, self._before.fps
        for place in file.places:
            length = place["length"]
            mine = table.slice(begin, length)
            numbers = _folder_and_file("data", file.number) | _folder_and_file("meta/episodes", file.number)
            new = place | numbers | {"episode_index": self._episode}
            new |= {"dataset_from_index": self._row, "dataset_to_index": self._row + length}
            for key in self._before.notes.cameras:
                new |= _folder_and_file(f"videos/{key}", file.number)
                new |= {
                    f"videos/{key}/from_timestamp": begin / fps,
                    f"videos/{key}/to_timestamp": (begin + length) / fps,
                }
            for name in NUMBERED:
                own = statistics_of(mine[name].to_numpy())
                new |= {f"{STATISTICS}{name}/{kind}": value for kind, value in own.items()}
            self._parts.append(_statistics(new))
            found.append(new)
            begin += length
            self._episode += 1
            self._row += length
        return found

    def _new_state(self, files: Sequence[_File]) -> DatasetState:
        before = self._before
        old = [place["episode_index"] for file in files for place in file.places]
        batches = max(before.notes.batches, *(file.number + 1 for file in files), 1)
        there = {file.number for file in files}
        notes = msgspec.structs.replace(
            before.notes,
            batches=batches,
            gone=[number for number in range(batches) if number not in there],
            drivers=list(self._drivers),
            episodes=[before.notes.episodes[number] for number in old],
        )
        info = before.info | {
            "total_episodes": self._episode,
            "total_frames": self._row,
            "total_tasks": len(self._tasks),
            "splits": {"train": f"0:{self._episode}"},
        }
        statistics = {name: merged_statistics([part[name] for part in self._parts]) for name in self._parts[0]}
        return DatasetState(
            robot=before.robot, fps=before.fps, notes=notes, tasks=self._tasks, info=info, statistics=statistics
        )


def _repeated(values: Sequence[int], lengths: Sequence[int]) -> list[int]:
    return [value for value, length in zip(values, lengths, strict=True) for _ in range(length)]


def _folder_and_file(kind: str, number: int) -> dict[str, int]:
    folder, file = place_of(number)
    return {f"{kind}/chunk_index": folder, f"{kind}/file_index": file}


def _pictures(place: Row, key: str, fps: int) -> range:
    begin = round(place[f"videos/{key}/from_timestamp"] * fps)
    return range(begin, begin + place["length"])


def _statistics(place: Row) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in place.items():
        if name.startswith(STATISTICS):
            feature, kind = name.removeprefix(STATISTICS).rsplit("/", 1)
            found.setdefault(feature, {})[kind] = value
    return found


def _table_of(rows: Sequence[Row]) -> pa.Table:
    return pa.table({name: [row[name] for row in rows] for name in rows[0]})


def _link_others(root: Path, new: Path, notes: DatasetNotes) -> None:
    """Link all files but those that are written anew, such as somebody's README."""
    own = {path for file in notes.files for path in _paths(file, notes)} | set(METADATA)
    for folder, folders, names in os.walk(root, onerror=raised):
        links = [name for name in folders if (Path(folder) / name).is_symlink()]
        for name in [*names, *links]:
            path = (Path(folder) / name).relative_to(root)
            if path.as_posix() not in own:
                with suppress(FileNotFoundError):  # gone meanwhile
                    _link(root / path, new / path)


def _paths(file: str, notes: DatasetNotes) -> list[str]:
    videos = [f"videos/{key}/{file}.mp4" for key in notes.cameras]
    return [f"data/{file}.parquet", f"meta/episodes/{file}.parquet", *videos]


def _link(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError as error:
        if error.errno not in WITHOUT_LINKS:
            raise
        shutil.copy2(source, target, follow_symlinks=False)
