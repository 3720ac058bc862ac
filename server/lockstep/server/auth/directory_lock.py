"""Lets one thread of one process at a time change the state directory."""

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from lockstep.server.util.state_dir import StateDir
from lockstep.server.util.steady_time import steady_time

__all__ = ["DirectoryLock"]


class DirectoryLock:
    """The lock of this process's threads, and with it that of all processes."""

    def __init__(self, directory: StateDir) -> None:
        self._directory = directory
        self._busy = threading.Lock()
        self._since = math.inf  # s, when `held` was entered

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold both locks while entered. Raises StateDirUnusable."""
        with self._busy:
            self._since = steady_time()
            try:
                with self._directory.locked():
                    yield
            finally:
                self._since = math.inf

    @contextmanager
    def unless_held(self) -> Iterator[bool]:
        """Keep the other threads out, without waiting for one that holds the lock; then the value is False."""
        is_free = self._busy.acquire(blocking=False)
        try:
            yield is_free
        finally:
            if is_free:
                self._busy.release()

    @property
    def seconds_held(self) -> float:
        """How long a thread of this process has been in `held`; negative if none is."""
        return steady_time() - self._since
