"""The audit log on disk: JSON lines, only ever appended to; a full file is rotated.

Each line carries the hash of the line before (`lockstep.server.evidence.chain`), across files and restarts.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from heapq import merge
from pathlib import Path

import msgspec

from lockstep.protocol.files.regular_file import bounded_lines, open_regular
from lockstep.server.audit.records import AuditRecord
from lockstep.server.evidence.chain import GENESIS, ChainedLine, Place, line_hash

__all__ = ["AuditFile", "chained_lines", "chatter_path", "last_records", "rotated", "stored_records"]

TAIL_BYTES = 1 << 20  # read when the console starts; thousands of records


class _Line(AuditRecord, frozen=True, kw_only=True, omit_defaults=True):
    """A record as it stands in the file."""

    before: str  # hash of the line before


_encoder = msgspec.json.Encoder()
_decoder = msgspec.json.Decoder(AuditRecord)


class AuditFile:
    """One file with its rotated ones. Blocks: used from the writer's thread only.

    Every method may raise OSError; lines that were whole stay whole.

    Attributes:
        last: number of the last record that was written or found; 0 without records
        head: hash of its line
    """

    def __init__(self, path: Path, max_bytes: int, files: int) -> None:
        self.last, self.head = 0, GENESIS
        self._path = path
        self._max_bytes = max_bytes
        self._files = files
        self._handle: int | None = None
        self._size = 0  # bytes of whole lines

    def write(self, records: list[AuditRecord]) -> None:
        """Write all records safely to disk, or none."""
        if self._handle is not None and not self._is_there(self._handle):
            self.close()  # somebody moved, deleted or replaced it
        self.open()
        data, head = self._chained(records)
        if self._size and self._size + len(data) > self._max_bytes:
            self.close()
            self._rotate()
        handle = self._opened()
        try:
            self._write_all(handle, data)
            os.fsync(handle)
        except OSError:
            with suppress(OSError):  # the first error is the one that says why
                os.ftruncate(handle, self._size)
            self.close()  # the next attempt looks at the disk anew
            raise
        self._size += len(data)
        if records:
            self.last, self.head = records[-1].n, head

    def open(self) -> None:
        """Open the file and find the end of the chain; the first `write` does it too."""
        if self._handle is None:
            self._opened()
            try:
                last, head = _end_of(self._path)
            except OSError:
                self.close()  # else the next record would begin a new chain
                raise
            if last >= self.last:  # else records of this run are gone: the chain goes on behind them and shows it
                self.last, self.head = last, head

    def _is_there(self, handle: int) -> bool:
        """True if the open file is the one at the path."""
        try:
            return os.path.samestat(os.fstat(handle), os.stat(self._path))
        except FileNotFoundError:
            return False

    def _chained(self, records: list[AuditRecord]) -> tuple[bytes, str]:
        """Return the records' lines and the hash of the last one."""
        lines, head = [], self.head
        for record in records:
            line = _encoder.encode(_Line(**msgspec.structs.asdict(record), before=head))
            head = line_hash(line)
            lines.append(line + b"\n")
        return b"".join(lines), head

    def close(self) -> None:
        if self._handle is not None:
            handle, self._handle = self._handle, None
            os.close(handle)

    def _opened(self) -> int:
        if self._handle is None:
            handle = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                size = os.fstat(handle).st_size
                if size and not _ends_line(self._path, size):
                    self._write_all(handle, b"\n")  # the last run ended in the middle of a line
                    size += 1
            except OSError:
                os.close(handle)
                raise
            self._handle, self._size = handle, size
        return self._handle

    @staticmethod
    def _write_all(handle: int, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[os.write(handle, view) :]

    def _rotate(self) -> None:
        for number in range(self._files - 1, 0, -1):
            older = rotated(self._path, number - 1)
            if older.exists():
                os.replace(older, rotated(self._path, number))
        if self._files == 1:
            self._path.unlink(missing_ok=True)


def rotated(path: Path, number: int) -> Path:
    """Return the path of the file that was rotated `number` times; 0 is the one that is written."""
    return path if number == 0 else path.with_name(f"{path.name}.{number}")


def chatter_path(path: Path) -> Path:
    """Return the path, beside the audit's own file, for records that a link can cause as often as it likes."""
    return path.with_name(f"{path.stem}-chatter{path.suffix}")


def stored_records(path: Path) -> Iterator[AuditRecord]:
    """Yield all records kept in both files, in the order of their numbers; skip lines that cannot be decoded."""
    own, chatter = (_stored(each) for each in (path, chatter_path(path)))
    return merge(own, chatter, key=lambda record: record.n)


def _stored(path: Path) -> Iterator[AuditRecord]:
    for _, line in chained_lines(path):
        with suppress(msgspec.DecodeError, UnicodeError, RecursionError):
            yield _decoder.decode(line)


def chained_lines(path: Path) -> Iterator[ChainedLine]:
    """Yield the lines of one file and of its rotated ones, oldest first."""
    numbers = {int(each.suffix[1:]) for each in path.parent.glob(f"{path.name}.*") if each.suffix[1:].isdecimal()}
    for number in (*sorted(numbers - {0}, reverse=True), 0):
        try:
            with open_regular(rotated(path, number)) as file:
                for count, line in enumerate(bounded_lines(file), 1):
                    yield ChainedLine(Place(rotated(path, number).name, count), line)
        except FileNotFoundError:
            continue


def last_records(path: Path) -> list[AuditRecord]:
    """Return the records at the end of the log; empty if it does not exist or cannot be read."""
    found: list[AuditRecord] = []
    for each in (path, chatter_path(path)):
        with suppress(OSError):  # the writer reports it
            found += [record for record, _ in _last_lines(each)]
    return sorted(found, key=lambda record: record.n)


def _end_of(path: Path) -> tuple[int, str]:
    """Return number and hash of the last line that is a record. Raises OSError: it cannot be read."""
    last = (0, GENESIS)
    for record, line in _last_lines(path):
        last = record.n, line_hash(line)
    return last


def _last_lines(path: Path) -> Iterator[tuple[AuditRecord, bytes]]:
    for each in (rotated(path, 1), path):
        try:
            with open_regular(each) as file:
                file.seek(max(0, os.fstat(file.fileno()).st_size - TAIL_BYTES))
                lines = file.read(TAIL_BYTES).split(b"\n")
        except FileNotFoundError:
            continue
        for line in lines:
            with suppress(msgspec.DecodeError, UnicodeError, RecursionError):
                yield _decoder.decode(line), line


def _ends_line(path: Path, size: int) -> bool:
    with open(path, "rb") as file:
        file.seek(size - 1)
        return file.read(1) == b"\n"
