"""Writes a file of everything that happens to events, one JSON line each: tests compare against it.

A separate thread writes the lines from a bounded queue, so the loop never blocks; lines that do not fit are counted.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO, Literal

import msgspec

from lockstep.robot_bridge.thread_name import name_thread

__all__ = ["EventKind", "EventLog"]

EventKind = Literal[
    "locked_out",
    "let_in",
    "start",
    "executed",
    "feedback",
    "refused",
    "media",
    "stop",
    "reset",
    "rest",
    "limit",
    "driven",
    "at_rest",
    "stall",
    "action",
]
Field = str | int | float | bool | Sequence[float | None] | list[str]

MAX_WAITING = 10_000  # lines

_logger = logging.getLogger(__name__)


class EventLog:
    """Writes records to a file in a thread.

    `record` may be called from the loop at any rate; `close` writes the waiting lines and blocks until that is done.
    """

    def __init__(self, path: Path | None) -> None:
        """`path`: None records nothing."""
        self.dropped = 0
        self._path = path
        self._waiting: queue.Queue[dict[str, Field] | None] = queue.Queue(MAX_WAITING)
        self._file: BinaryIO | None = None
        self._writer = threading.Thread(target=self._write, name="event-log", daemon=True)

    def open(self) -> None:
        """Append to the file from now on. What is recorded earlier is lost.

        Raises:
            OSError: the file cannot be opened.
        """
        if self._path is not None:
            self._file = self._path.open("ab")
            self._writer.start()

    def record(self, kind: EventKind, event: int, *, at: float | None = None, **fields: Field) -> None:
        """Add a line. `at`: time on the bridge's monotonic clock, as in feedback and media; None: now."""
        if self._file is None:
            return
        when = time.monotonic() if at is None else at
        try:
            self._waiting.put_nowait({"kind": kind, "time": when, "event": event, **fields})
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        """Write the waiting lines and close the file. Blocks; call it from a thread if that matters. Idempotent."""
        if self._writer.is_alive():
            self._waiting.put(None)
            self._writer.join()

    def _write(self) -> None:
        name_thread("event-log")
        file = self._file
        assert file is not None  # `open` starts this thread once it has the file
        works = True
        while (line := self._waiting.get()) is not None:
            if works:
                works = self._try(partial(self._append, file, line))
            else:
                self.dropped += 1
        self._try(file.close)

    def _append(self, file: BinaryIO, line: dict[str, Field]) -> None:
        file.write(msgspec.json.encode(line) + b"\n")
        if self._waiting.empty():
            file.flush()

    def _try(self, work: Callable[[], None]) -> bool:
        try:
            work()
        except OSError as error:
            _logger.error("the event log is cut off here: %s", error)
            return False
        return True
