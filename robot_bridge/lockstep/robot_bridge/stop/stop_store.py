"""Reads and writes the latched stop on the robot's disk, and says what the contents of a state directory mean.

`start_of` has the rules and does no I/O. `StopStore` does the I/O, and blocks: call it from a thread. There are two
files: `stop.json` has the latch; `numbers.json` shows that the directory was used before, reserves stop numbers far
beyond those in use, and is locked while a bridge runs. A bridge that hung leaves a third, `ended.txt`, which says so.
docs/robot-link.md, "On the robot's disk", says what follows from them.
"""

import errno
import fcntl
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import msgspec

from lockstep.robot_bridge.errors import StateDirInUse, StateDirUnusable
from lockstep.robot_bridge.stop.stop_latch import MAX_NUMBER, StopRecord

__all__ = ["RESERVED", "Found", "Kept", "Start", "StopStore", "start_of", "wall_microseconds"]

STOP_FILE = "stop.json"
NUMBERS_FILE = "numbers.json"
NOTE_FILE = "ended.txt"
MAX_NOTE = 500  # characters
MAX_BYTES = 1 << 20  # of a file that is read
RESERVED = 1 << 30  # numbers that are reserved at each start
RESERVED_BYTES = 64  # size of the file with the reserve, spaces included
LATEST_CLOCK = 2**52  # microseconds; a clock beyond it, in the year 2112, is wrong


class Kept(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of `stop.json`."""

    version: int = 1
    latch: StopRecord
    ended: bool  # the bridge has ended in order; false while one runs


class Reserved(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of `numbers.json`."""

    up_to: int  # no number above this was given


_read_kept = msgspec.json.Decoder(Kept)
_read_reserved = msgspec.json.Decoder(Reserved)


class Found(NamedTuple):
    """The contents of a state directory."""

    used: bool  # a bridge has run here before
    kept: Kept | None  # None: missing or unreadable
    trouble: str = ""  # why it is unreadable, in words; "" when it is missing
    reserved: int = 0  # 0: unknown
    note: str = ""  # the reason that the previous bridge gave for its end; "" without one
    older: "tuple[Found, ...]" = ()  # the records of the directories that a new one replaces


class Start(NamedTuple):
    """The state in which a bridge begins."""

    record: StopRecord
    numbers_after: int
    stop_reason: str  # a stop to latch before anything else; "" for none


def wall_microseconds() -> int:
    """Return the microseconds since 1970. The clock may be wrong or set back: use it only for a first stop number."""
    return time.time_ns() // 1000


def start_of(found: Found, wall_microseconds: int) -> Start:
    """Return the state in which a bridge begins that finds these contents.

    `wall_microseconds`: since 1970, by a clock that may be wrong.

    Numbers go on after the newest on the disk. The clock and the reserve matter if that number may not be the newest:
    when the directory was deleted, restored from a backup or damaged, or the bridge did not end in order.
    """
    clock = max(0, min(wall_microseconds, LATEST_CLOCK))
    if not found.used and found.older:
        return _start_of_all([start_of(each, wall_microseconds) for each in found.older])
    if found.kept is None:
        if not found.used:
            return Start(StopRecord(), clock, "")
        what = f"cannot be read ({found.trouble})" if found.trouble else "is missing"
        return Start(StopRecord(), max(clock, found.reserved), f"The robot's stop file {what}")
    record = found.kept.latch
    if found.kept.ended:
        return Start(record, max(clock, record.number), "")
    # The bridge may have given numbers that never reached the disk.
    numbers_after = max(clock, record.number, found.reserved)
    reason = found.note or "The robot bridge did not shut down cleanly: power cut, kill, crash or hang"
    return Start(record, numbers_after, reason)


def _start_of_all(starts: Sequence[Start]) -> Start:
    """Combine the starts of several directories: the robot is stopped if one of them is."""
    held = [start for start in starts if start.record.stopped or start.stop_reason]
    newest = max(held or starts, key=lambda start: start.record.number)
    return newest._replace(numbers_after=max(max(each.numbers_after, each.record.number) for each in starts))


class StopStore:
    """Owns a state directory; no other bridge may use it meanwhile.

    Raises, from `open`:
        StateDirInUse: another bridge uses it.
        StateDirUnusable: it cannot be made, read or written.
    """

    def __init__(self, directory: Path, older: Sequence[Path] = ()) -> None:
        """`older`: directories that a new directory replaces; they are read and not changed."""
        self._directory = directory
        self._older = older
        self._lock = -1  # descriptor of `numbers.json`

    def open(self) -> Found:
        """Lock the directory and read it, and the older ones if it is new."""
        try:
            older = () if self._is_used() else tuple(map(_look_into, self._older))
            self._directory.mkdir(mode=0o700, parents=True, exist_ok=True)
            used = self._is_used()
            self._lock = os.open(self._directory / NUMBERS_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            self.close()
            raise StateDirInUse(
                f"{self._directory}: another bridge keeps its stop here. Run one bridge for each robot; a second "
                "robot of the same name needs its own directory, --state-dir DIR"
            ) from error
        except OSError as error:
            self.close()
            raise StateDirUnusable(f"{self._directory}: {error.strerror or error}") from error
        kept, trouble = self._read()
        return Found(used, kept, trouble, self._read_reserved(), self._read_note(), older)

    def _is_used(self) -> bool:
        return (self._directory / NUMBERS_FILE).exists() or (self._directory / STOP_FILE).exists()

    def write(self, kept: Kept) -> None:
        """Replace the latch in one step; when this returns, the latch has reached the disk.

        A directory that was removed meanwhile is made again.

        Raises:
            OSError: the latch has not reached the disk, or that is unknown.
        """
        if not self._has_directory():
            self._take_again()
        path = self._directory / STOP_FILE
        with suppress(FileNotFoundError):
            path.with_suffix(".new").unlink()
        descriptor = os.open(path.with_suffix(".new"), os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        try:
            write_all(descriptor, msgspec.json.encode(kept))
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        os.replace(path.with_suffix(".new"), path)
        (self._directory / NOTE_FILE).unlink(missing_ok=True)  # `stop.json` has its reason now
        self._sync_directory()

    def is_there(self) -> bool:
        """Return whether the written files are still where the next bridge looks for them."""
        return self._has_directory() and (self._directory / STOP_FILE).exists()

    def _has_directory(self) -> bool:
        """Return whether the directory is still the one that this bridge has locked."""
        try:
            return os.path.samestat(os.stat(self._directory / NUMBERS_FILE), os.fstat(self._lock))
        except OSError:
            return False

    def _take_again(self) -> None:
        """Make and lock the directory again.

        Raises:
            OSError: the directory cannot be made, or another bridge uses the one that is there now.
        """
        reserved = os.pread(self._lock, RESERVED_BYTES, 0)
        self._directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        fresh = os.open(self._directory / NUMBERS_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(fresh, fcntl.LOCK_EX | fcntl.LOCK_NB)
            write_all(fresh, reserved)
            os.ftruncate(fresh, len(reserved))
        except OSError as error:
            os.close(fresh)
            if isinstance(error, BlockingIOError):
                raise OSError(errno.EBUSY, f"another bridge has taken {self._directory}") from error
            raise
        self.close()
        self._lock = fresh

    def note_end(self, reason: str) -> None:
        """Tell the next bridge why this one does not end in order. From any thread; `write` takes it back.

        Raises:
            OSError: the reason cannot be written.
        """
        (self._directory / NOTE_FILE).write_text(reason[:MAX_NOTE])

    def reserve(self, number: int) -> int:
        """Reserve numbers after `number`; return the highest, above which none may be given before the next call.

        The file is written in place, since it is the lock, and always with the same size: a full disk leaves the older
        one.

        Raises:
            OSError: as for `write`.
        """
        up_to = min(number + RESERVED, MAX_NUMBER)
        os.lseek(self._lock, 0, os.SEEK_SET)
        write_all(self._lock, msgspec.json.encode(Reserved(up_to=up_to)).ljust(RESERVED_BYTES))
        os.ftruncate(self._lock, RESERVED_BYTES)
        os.fsync(self._lock)
        self._sync_directory()
        return up_to

    def close(self) -> None:
        """Release the directory to other bridges. May be called again."""
        descriptor, self._lock = self._lock, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _read(self) -> tuple[Kept | None, str]:
        try:
            with (self._directory / STOP_FILE).open("rb") as file:
                kept = _read_kept.decode(file.read(MAX_BYTES))
        except FileNotFoundError:
            return None, ""
        except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            return None, str(error)[:200]
        if kept.version != 1 or not 0 <= kept.latch.number <= MAX_NUMBER:
            return None, f"version {kept.version}, number {kept.latch.number}"
        return kept, ""

    def _read_reserved(self) -> int:
        try:
            data = os.pread(self._lock, MAX_BYTES, 0)
            return max(0, min(_read_reserved.decode(data).up_to, MAX_NUMBER))
        except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return 0

    def _read_note(self) -> str:
        try:
            with (self._directory / NOTE_FILE).open(errors="replace") as file:
                return file.read(MAX_NOTE)
        except OSError:
            return ""

    def _sync_directory(self) -> None:
        """Write the directory itself: until then a new file name is not on the disk."""
        descriptor = os.open(self._directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _look_into(directory: Path) -> Found:
    """Return the contents of an older directory, and lock it meanwhile against other bridges."""
    store = StopStore(directory)
    try:
        return store.open()
    finally:
        store.close()


def write_all(descriptor: int, data: bytes) -> None:
    """Write all of `data`: one call may write only a part."""
    while data:
        data = data[os.write(descriptor, data) :]
