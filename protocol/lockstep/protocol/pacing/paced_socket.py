"""The transport of a protocol whose data come by a paced reader."""

import asyncio
from collections.abc import Iterable
from typing import Any

from lockstep.protocol.pacing.paced_reader import PacedReader

__all__ = ["PacedSocket"]


class PacedSocket(asyncio.Transport):
    """The transport of a protocol whose data come by a `PacedReader`: pausing it pauses the reader.

    Once it is closed on this side, the reader drops what has come.
    """

    def __init__(self, below: asyncio.Transport, reader: PacedReader) -> None:
        super().__init__()
        self._below = below
        self._reader = reader
        reader.begin(below)

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return self._below.get_extra_info(name, default)

    def is_closing(self) -> bool:
        return self._below.is_closing()

    def close(self) -> None:
        self._reader.end()
        self._below.close()

    def abort(self) -> None:
        self._reader.end()
        self._below.abort()

    def pause_reading(self) -> None:
        self._reader.pause_reading()

    def resume_reading(self) -> None:
        self._reader.resume_reading()

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self._below.write(data)

    def writelines(self, list_of_data: Iterable[bytes | bytearray | memoryview]) -> None:
        self._below.writelines(list_of_data)

    def can_write_eof(self) -> bool:
        return self._below.can_write_eof()

    def write_eof(self) -> None:
        self._below.write_eof()

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        self._below.set_write_buffer_limits(high, low)

    def get_write_buffer_size(self) -> int:
        return self._below.get_write_buffer_size()
