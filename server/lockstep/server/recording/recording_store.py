"""The directory of recordings: lists them, completes interrupted ones, deletes the oldest. Blocks."""

import fcntl
import math
import os
import threading
import time
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import msgspec
import structlog

from lockstep.server.recording.episodes.edits import edited, edits_path, edits_version, read_edits
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.scan import complete_file
from lockstep.server.recording.settings import RecordingSettings

__all__ = [
    "FileVersion",
    "RecordingEntry",
    "RecordingStore",
    "entry_of",
    "file_version",
    "is_written",
    "recording_id",
]

log = structlog.get_logger(__name__)

SUFFIX = ".mcap"
DAY = 86_400.0
LIST_SECONDS = 1.0  # life of a list: further requests within it cost no more than a look at the directory
SETTLED_NS = 100_000_000  # within this time of a directory's last change, a later one may bear the same time


class RecordingEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One file. Times in µs since 1970."""

    id: str  # as `recording_id`
    recording: str
    part: int
    name: str
    robot: str
    epoch: str
    by: str
    started: int
    ended: int
    first_event: int
    last_event: int
    bytes: int
    marks: dict[str, int]  # number of each kind
    episodes: dict[str, int] = {}  # number in each state: "kept", "discarded", "cut", "open"; with all changes
    lost: int
    running: bool
    interrupted: bool


class FileVersion(NamedTuple):
    """Differs whenever a recording, or a change to its episodes, was written."""

    inode: int
    size: int
    changed: int  # ns
    edits: tuple[int, int, int]


class _Listed(NamedTuple):
    """A list of the directory."""

    at: float  # s, monotonic; minus infinity: it may have changed since without a sign
    changed: int  # ns, last change of the directory
    written: list[Path]  # files that were being written
    entries: list[RecordingEntry]


def recording_id(path: Path) -> str:
    """Return the file's name without its suffix; bytes that are no UTF-8 are replaced."""
    return os.fsencode(path.stem).decode(errors="replace")


class RecordingStore:
    """One directory of recordings, for use from any thread.

    Other files are passed over, and so are symbolic links: the right to read recordings is no right to read elsewhere.
    """

    def __init__(self, directory: Path, settings: RecordingSettings) -> None:
        self.directory = directory
        self._settings = settings
        self._busy = threading.Lock()  # one list at a time: the next one finds all entries known
        self._listed = _Listed(-math.inf, -1, [], [])
        self._written: list[Path] = []  # files being written that the list under way has found
        self._known: dict[Path, tuple[FileVersion, RecordingEntry | None]] = {}

    def prepare(self) -> None:
        """Make the directory. Raises OSError."""
        self.directory.mkdir(mode=0o700, parents=True, exist_ok=True)

    def files(self) -> list[Path]:
        """Return the recording files. Raises OSError: the directory cannot be read."""
        return [path for path in self.directory.glob(f"*{SUFFIX}") if path.is_file() and not path.is_symlink()]

    def path(self, wanted: str) -> Path | None:
        """Return the file of that id, or None. Raises OSError."""
        return next((path for path in self.files() if recording_id(path) == wanted), None)

    def entries(self) -> list[RecordingEntry]:
        """Return the recordings, newest first, without files that are being written. Raises OSError."""
        with self._busy:
            if not self._is_still(self._listed):
                self._listed = self._list()
            return [*self._listed.entries]

    def _list(self) -> _Listed:
        now, changed = time.monotonic(), _changed(self.directory)
        paths = self.files()
        present = set(paths)
        self._known = {path: known for path, known in self._known.items() if path in present}
        self._written = []
        found = [entry for path in paths if (entry := self._entry(path)) is not None]
        if time.time_ns() - changed < SETTLED_NS:
            now = -math.inf
        return _Listed(now, changed, self._written, sorted(found, key=lambda entry: entry.started, reverse=True))

    def _is_still(self, listed: _Listed) -> bool:
        """True if nothing was made, deleted or finished since."""
        try:
            return (
                time.monotonic() - listed.at < LIST_SECONDS
                and _changed(self.directory) == listed.changed
                and all(map(_is_locked, listed.written))
            )
        except OSError:
            return False

    def _entry(self, path: Path) -> RecordingEntry | None:
        try:
            version = file_version(path)
            known = self._known.get(path)
            if known is not None and known[0] == version:
                return known[1]
            entry = None
            if _is_locked(path):
                self._written.append(path)
            else:
                with RecordingReader(path) as reader:
                    entry = entry_of(path, reader.info, reader.index, interrupted=reader.interrupted)
                self._known[path] = version, entry
            return entry
        except (RecordingError, OSError):
            return None

    def recover(self) -> int:
        """Complete the files that were interrupted, and return their number."""
        count = 0
        for path in self.files():
            try:
                if _is_locked(path):
                    continue
                with RecordingReader(path) as reader:
                    if not reader.interrupted:
                        continue
                    info, empty = reader.info, not reader.index.chunks
                if empty:
                    path.unlink()
                    continue
                complete_file(path, info)
                count += 1
                log.warning("an interrupted recording was completed", file=path.name)
            except (RecordingError, OSError) as error:
                log.error("an interrupted recording cannot be completed", file=path.name, reason=str(error))
        return count

    def prune(self, keep: Collection[Path] = ()) -> list[str]:
        """Delete recordings that are too old, and the oldest while there are too many bytes; return their ids.

        Raises:
            OSError: the directory cannot be read.
        """
        dated = []
        for path in self.files():
            with suppress(OSError):  # another process deletes too
                status = path.stat()
                dated.append((status.st_mtime, status.st_size, path))
        total = sum(size for _, size, _ in dated)
        oldest = time.time() - self._settings.age_days * DAY
        gone = []
        for changed, size, path in sorted(dated):
            if total <= self._settings.total_bytes and changed >= oldest:
                break
            try:
                if path in keep or _is_locked(path):
                    continue
                self.delete(path)
            except OSError as error:
                log.error("a recording cannot be deleted", file=path.name, reason=error.strerror)
                continue
            total -= size
            gone.append(recording_id(path))
            log.warning("a recording was deleted to make room", file=path.name)
        return gone

    def delete(self, path: Path) -> None:
        """Delete a recording, and the changes to its episodes. Raises OSError."""
        path.unlink(missing_ok=True)
        edits_path(path).unlink(missing_ok=True)


def file_version(path: Path) -> FileVersion:
    """Return the version of a recording and of the changes to its episodes. Raises OSError."""
    status = path.stat()
    return FileVersion(status.st_ino, status.st_size, status.st_mtime_ns, edits_version(path))


def is_written(path: Path) -> bool:
    """Return whether a process writes the file now. Raises OSError."""
    return _is_locked(path)


def _edited(path: Path, index: EventIndex) -> list[EpisodeEntry]:
    """Return the episodes with the changes to them; as they were recorded where the changes cannot be read."""
    if not index.episodes:
        return []
    try:
        return edited(index.episodes, read_edits(path))
    except OSError:
        return index.episodes


def entry_of(
    path: Path, info: RecordingInfo, index: EventIndex, *, running: bool = False, interrupted: bool = False
) -> RecordingEntry:
    episodes: dict[str, int] = {}
    for episode in _edited(path, index):
        episodes[episode.state] = episodes.get(episode.state, 0) + 1
    marks: dict[str, int] = {}
    for mark in index.marks:
        marks[mark.kind] = marks.get(mark.kind, 0) + 1
    return RecordingEntry(
        id=recording_id(path),
        recording=info.recording,
        part=info.part,
        name=info.name,
        robot=info.robot,
        epoch=info.epoch,
        by=info.by,
        started=index.started,
        ended=index.ended,
        first_event=index.first_event,
        last_event=index.last_event,
        bytes=path.stat().st_size,
        marks=marks,
        episodes=episodes,
        lost=index.lost,
        running=running,
        interrupted=interrupted,
    )


def _changed(directory: Path) -> int:
    """Return the time of the last creation or deletion in it, in ns; -1: not known."""
    try:
        return directory.stat().st_mtime_ns
    except OSError:
        return -1


def _is_locked(path: Path) -> bool:
    """True if the file is being written now."""
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        return False
