"""Changes to the episodes of a recording, in a file beside it: the recording itself never changes. Blocks.

`NAME.episodes.jsonl` belongs to `NAME.mcap`. Each line is one change; lines are only added. `edit_rules` says what they
mean. The file is as little trusted as a recording is: its bytes are bounded, and a link to elsewhere is not followed.
"""

import errno
import fcntl
import os
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import msgspec

from lockstep.server.recording.episodes.edit_rules import (
    EditedEpisodes,
    EpisodeEdit,
    apply_edits,
    edited,
)
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.episodes import EpisodeEntry

__all__ = [
    "MAX_EDITS",
    "EpisodeEdit",
    "EpisodeEditRefused",
    "EpisodeEditStale",
    "add_edit",
    "edited",
    "edits_path",
    "edits_version",
    "read_edits",
]

MAX_BYTES = 16 * 1024 * 1024
MAX_EDITS = 10_000


class EpisodeEditRefused(RecordingError):
    """This change of an episode is not allowed."""


class EpisodeEditStale(EpisodeEditRefused):
    """Somebody else has changed the episodes since."""


_decoder = msgspec.json.Decoder(EpisodeEdit)


def edits_path(recording: Path) -> Path:
    return recording.with_suffix(".episodes.jsonl")


def edits_version(recording: Path) -> tuple[int, int, int]:
    """Return what differs after each change: inode, size and time of change; zeros without the file."""
    try:
        found = edits_path(recording).lstat()
    except OSError:
        return 0, 0, 0
    return found.st_ino, found.st_size, found.st_mtime_ns


def read_edits(recording: Path) -> list[EpisodeEdit | None]:
    """Return the changes by their numbers; None for a line that cannot be read. Raises OSError."""
    try:
        with _opened(edits_path(recording), os.O_RDONLY) as file:
            return _read(file)
    except FileNotFoundError:
        return []


def add_edit(
    recording: Path, episodes: Sequence[EpisodeEntry], edit: EpisodeEdit, after: int | None = None
) -> EditedEpisodes:
    """Add a change; return all episodes as they are then.

    Args:
        episodes: as they were recorded
        after: number of the newest change that its author knows; None: any

    Raises:
        EpisodeEditStale: there are newer changes than `after`.
        EpisodeEditRefused: it is not allowed; nothing was written.
        OSError: the change cannot be written.
    """
    path = edits_path(recording)
    is_new = not path.exists()
    if is_new:
        _checked(episodes, [], edit)  # a refused one makes no file
    with _opened(path, os.O_RDWR | os.O_CREAT | os.O_APPEND) as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # another process may add one too
        edits = _read(file)
        if after is not None and after != len(edits):
            raise EpisodeEditStale(f"there are {len(edits)} changes by now, and this one was made after {after}")
        line = msgspec.json.encode(edit)
        size = file.seek(0, os.SEEK_END)
        if len(edits) >= MAX_EDITS or size + len(line) + 2 > MAX_BYTES:
            raise EpisodeEditRefused(f"there are {len(edits)} changes already, and no room for more")
        found = _checked(episodes, edits, edit)
        # A line that a crash has cut short ends here.
        file.write((b"\n" if size else b"") + line + b"\n")
        file.flush()
        os.fsync(file.fileno())
    if is_new:
        _sync_directory(path.parent)
    return found


def _checked(
    episodes: Sequence[EpisodeEntry], edits: Sequence[EpisodeEdit | None], edit: EpisodeEdit
) -> EditedEpisodes:
    """Return the episodes with the change. Raises EpisodeEditRefused."""
    found = apply_edits(episodes, [*edits, edit])
    why = found.without_effect.get(len(edits) + 1)
    if why is not None:
        raise EpisodeEditRefused(why)
    if edit.undo is not None:
        before = apply_edits(episodes, edits)
        if edit.undo in before.without_effect:
            raise EpisodeEditRefused(f"change {edit.undo} has no effect")
        if found.without_effect.keys() - before.without_effect.keys():
            raise EpisodeEditRefused(f"a later change builds on change {edit.undo}; take that back first")
    return found


def _opened(path: Path, flags: int) -> BinaryIO:
    """Open a regular file; a link, a FIFO or a device is refused. Raises OSError."""
    number = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o600)
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return os.fdopen(number, "r+b") if flags & os.O_RDWR else os.fdopen(number, "rb")


def _read(file: BinaryIO) -> list[EpisodeEdit | None]:
    file.seek(0)
    lines = [line for line in file.read(MAX_BYTES).splitlines() if line.strip()]
    return [_decoded(line) for line in lines[:MAX_EDITS]]


def _decoded(line: bytes) -> EpisodeEdit | None:
    try:
        return _decoder.decode(line)
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None


def _sync_directory(directory: Path) -> None:
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
