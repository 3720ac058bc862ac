"""Writes the audit log in a thread: a slow or full disk delays nothing and stops nothing."""

import queue
import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol

import structlog

from lockstep.server.audit.records import AuditRecord

__all__ = ["AuditWriter", "RecordFile"]

log = structlog.get_logger(__name__)

MAX_WAITING = 4096  # records; then the oldest of those that could not be written are dropped
RETRY_SECONDS = 2.0
SETTLE_SECONDS = 5.0  # between two calls of `settle` while no record comes
CLOSE_SECONDS = 3.0


class RecordFile(Protocol):
    def write(self, records: list[AuditRecord]) -> None: ...
    def settle(self) -> None: ...
    def close(self) -> None: ...


class AuditWriter:
    """The writer's thread. Call `start`, `append` from the loop, and `close` at the end, which writes what waits.

    Args:
        changed: called from the thread when writing begins to fail, with the reason, and with "" when it works again

    Attributes:
        lost: records that were never written
        failures: attempts to write that failed
    """

    def __init__(self, file: RecordFile, changed: Callable[[str], None], retry_seconds: float = RETRY_SECONDS) -> None:
        self.lost = 0
        self.failures = 0
        self._file = file
        self._changed = changed
        self._retry_seconds = retry_seconds
        self._queue: queue.Queue[AuditRecord] = queue.Queue(MAX_WAITING)
        self._trouble = ""
        self._closing = threading.Event()
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def append(self, record: AuditRecord) -> None:
        try:
            self._queue.put_nowait(record)
        except queue.Full:
            self.lost += 1
        self._wake.set()

    def close(self) -> None:
        """End the thread; give up after a few seconds if the disk does not answer. Idempotent."""
        self._closing.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(CLOSE_SECONDS)

    def _run(self) -> None:
        waiting: deque[AuditRecord] = deque()
        while not self._closing.is_set():
            self._wake.wait(SETTLE_SECONDS)
            self._wake.clear()
            while not self._attempt(waiting):
                if self._closing.wait(self._retry_seconds):
                    break
            else:
                self._file.settle()
        self._attempt(waiting)
        self.lost += len(waiting)
        self._file.close()

    def _attempt(self, waiting: deque[AuditRecord]) -> bool:
        """Write all records that wait; False if that has to be tried again later."""
        while not self._queue.empty():
            waiting.append(self._queue.get_nowait())
            if len(waiting) > MAX_WAITING:
                waiting.popleft()
                self.lost += 1
        if not waiting:
            return True
        try:
            self._file.write(list(waiting))
        except Exception as error:  # not OSError alone: this thread must not end silently
            self.failures += 1
            self._report(getattr(error, "strerror", None) or str(error) or type(error).__name__)
            return False
        waiting.clear()
        self._report("")
        return True

    def _report(self, trouble: str) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self._changed(trouble)
