"""Watches a lock-out file at the robot: while it exists, the robot is locked.

A thread looks at the file, because a disk may hang.
"""

import threading
import time
from collections.abc import Callable
from pathlib import Path

__all__ = ["LockoutFile", "look_at"]

INTERVAL = 0.2  # s between two looks
PATIENCE = 1.5  # s without a look after which the state is unknown
JOIN_SECONDS = 1.0


def look_at(path: Path) -> str:
    """Return why the robot is locked out, or "" if it is not. A file that cannot be looked at counts as locked."""
    try:
        path.lstat()
        return f"locked at the robot ({path})"
    except FileNotFoundError:
        pass
    except OSError as error:
        return f"the lock-out file cannot be checked ({path}: {error.strerror or error})"
    try:
        path.parent.stat()
    except OSError as error:
        return f"the folder of the lock-out file cannot be checked ({path.parent}: {error.strerror or error})"
    return ""


class LockoutFile:
    """Looks at the file in a thread: call `start`, read `reason`. Until the first look the robot counts as locked."""

    def __init__(
        self,
        path: Path,
        *,
        look: Callable[[Path], str] = look_at,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._path = path
        self._look = look
        self._clock = clock
        self._seen: tuple[str, float] = (f"the lock-out file has not been checked yet ({path})", clock())
        self._looked = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lock-out file", daemon=True)

    @property
    def reason(self) -> str:
        """The reason why the robot is locked out now; "" while it is not."""
        reason, seen_at = self._seen
        if not reason and self._clock() - seen_at > PATIENCE:
            return f"the lock-out file cannot be checked in time ({self._path})"
        return reason

    def start(self) -> None:
        """Start the thread, and block until the first look is over, for at most `PATIENCE`."""
        self._thread.start()
        self._looked.wait(PATIENCE)

    def close(self) -> None:
        """End the thread; blocks for at most `JOIN_SECONDS`, and abandons a look that hangs."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join(JOIN_SECONDS)

    def _run(self) -> None:
        while True:
            began = self._clock()
            self._seen = (self._look(self._path), began)
            self._looked.set()
            if self._ending.wait(INTERVAL):
                return
