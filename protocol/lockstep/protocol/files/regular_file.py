"""Opens files that somebody else may have put there without waiting, and reads them in lines that fit in memory."""

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

__all__ = ["MAX_LINE", "bounded_lines", "open_regular"]

MAX_LINE = 1 << 20  # bytes; the console's own lines have some hundred


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading. A FIFO would wait for somebody to write to it, and a device may never end.

    Raises:
        OSError: it cannot be opened, or is not a regular file.
    """
    file = open(path, "rb", opener=_without_waiting)  # noqa: SIM115
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return file


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


def bounded_lines(file: BinaryIO) -> Iterator[bytes]:
    """Yield the lines without their ends; only the beginning of a line longer than `MAX_LINE`."""
    while line := file.readline(MAX_LINE):
        yield line.rstrip(b"\n")
        while len(line) == MAX_LINE and not line.endswith(b"\n"):
            line = file.readline(MAX_LINE)
