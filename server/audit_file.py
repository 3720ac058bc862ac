"""The audit log on disk: JSON lines, only ever appended to; a full file is set aside and a new one begun."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import msgspec

from server.audit import AuditRecord

__all__ = ["AuditFile", "last_records", "rotated", "stored_records"]

TAIL_BYTES = 1 << 20  # looked at when the console starts; thousands of records

_encoder = msgspec.json.Encoder()
_decoder = msgspec.json.Decoder(AuditRecord)


class AuditFile:
    """Blocks: used from the writer's thread only. Every method may raise OSError; what was whole stays whole."""

    def __init__(self, path: Path, max_bytes: int, files: int) -> None:
        self._path = path
        self._max_bytes = max_bytes
        self._files = files
        self._handle: int | None = None
        self._size = 0  # of what is known to be whole

    def write(self, records: list[AuditRecord]) -> None:
        """All of them, safely on disk, or none."""
        data = b"".join(_encoder.encode(record) + b"\n" for record in records)
        if self._handle is not None and self._size and self._size + len(data) > self._max_bytes:
            self.close()
            self._rotate()
        handle = self._open()
        try:
            self._write_all(handle, data)
            os.fsync(handle)
        except OSError:
            with suppress(OSError):  # the first error is the one that says why
                os.ftruncate(handle, self._size)
            self.close()  # what is on disk is looked at anew before the next attempt
            raise
        self._size += len(data)

    def close(self) -> None:
        if self._handle is not None:
            handle, self._handle = self._handle, None
            os.close(handle)

    def _open(self) -> int:
        if self._handle is None:
            handle = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
            self._handle, self._size = handle, os.fstat(handle).st_size
            if self._size and not _ends_line(self._path, self._size):
                self._write_all(handle, b"\n")  # the last run ended in the middle of a line
                self._size += 1
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
    """The file that was set aside `number` times; 0 is the one that is written."""
    return path if number == 0 else path.with_name(f"{path.name}.{number}")


def stored_records(path: Path) -> Iterator[AuditRecord]:
    """All that is kept, oldest first; lines that cannot be understood are passed over."""
    numbers = 0
    while rotated(path, numbers + 1).exists():
        numbers += 1
    for number in range(numbers, -1, -1):
        try:
            with open(rotated(path, number), "rb") as file:
                yield from _parsed(file)
        except FileNotFoundError:
            continue


def last_records(path: Path) -> list[AuditRecord]:
    """Those at the end of the log; empty when there is none or it cannot be read."""
    found: list[AuditRecord] = []
    for each in (rotated(path, 1), path):
        try:
            with open(each, "rb") as file:
                file.seek(max(0, os.fstat(file.fileno()).st_size - TAIL_BYTES))
                found += _parsed(iter(file.read(TAIL_BYTES).splitlines()))
        except OSError:
            continue
    return found


def _parsed(lines: Iterator[bytes]) -> Iterator[AuditRecord]:
    for line in lines:
        try:
            yield _decoder.decode(line)
        except (msgspec.DecodeError, UnicodeError, RecursionError):
            continue


def _ends_line(path: Path, size: int) -> bool:
    with open(path, "rb") as file:
        file.seek(size - 1)
        return file.read(1) == b"\n"
