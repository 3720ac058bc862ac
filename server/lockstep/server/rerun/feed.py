"""The thread that hands a session to the process which speaks to Rerun. The console's loop only appends to a queue."""

import os
import pickle
import threading
import time

from lockstep.server.recording.writing.live_queue import LiveQueue, size_of
from lockstep.server.recording.writing.queue_items import Item, RobotItem

__all__ = ["LENGTH", "Feed"]

DRAIN_SECONDS = 0.1  # between two looks at the queue: each look takes the interpreter from the loop for a moment
BATCH_BYTES = 200_000  # about, of the items that are handed over together
LENGTH = 4  # bytes, big-endian, before each batch


class Feed:
    """Writes items to a pipe. `put` from the loop at any rate.

    A full queue drops its oldest items, and counts them. A process that does not read blocks this thread alone.

    Attributes:
        broken: set when the process has closed its end
    """

    def __init__(self, pipe: int) -> None:
        """`pipe`: the descriptor to write to, which the feed closes."""
        self.broken = threading.Event()
        self._pipe = pipe
        self._waiting = LiveQueue()
        self._robot: RobotItem | None = None  # the newest: without it nothing can be logged
        self._since: float | None = None  # s, monotonic: of the write that goes on
        self._news = threading.Event()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rerun", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def put(self, item: Item) -> None:
        """Queue an item without blocking."""
        self._waiting.put(item)
        if isinstance(item, RobotItem):
            self._robot, self._waiting.dropped_robot = item, False
        self._news.set()

    @property
    def dropped(self) -> int:
        """The number of items that were dropped."""
        return self._waiting.dropped

    def lost_pictures(self) -> bool:
        """Return whether a picture or sound was dropped since the last call."""
        lost, self._waiting.dropped_media = self._waiting.dropped_media, False
        return lost

    def blocked_for(self, now: float) -> float:
        """Return for how many seconds the process has taken nothing of a write."""
        since = self._since
        return 0.0 if since is None else now - since

    def close(self) -> None:
        """End after what waits, or at once if it has not begun. Does not block; `join` waits."""
        if self._thread.ident is None and not self._closing.is_set():
            os.close(self._pipe)
        self._closing.set()
        self._news.set()

    def join(self) -> None:
        """Wait for the end. Blocks for as long as the process neither reads nor ends."""
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        try:
            while not self.broken.is_set():
                self._news.wait()
                self._news.clear()
                ending = self._closing.is_set()
                while batch := self._take():
                    self._write(batch)
                    time.sleep(0)  # the loop goes first
                if ending:
                    break
                self._closing.wait(DRAIN_SECONDS)
        except OSError:  # the process is gone
            self.broken.set()
        finally:
            os.close(self._pipe)

    def _take(self) -> list[Item]:
        """Return the oldest items that wait; none: nothing does."""
        found: list[Item] = []
        size = 0
        while size < BATCH_BYTES:
            if self._waiting.dropped_robot and self._robot is not None:
                self._waiting.dropped_robot = False
                found.append(self._robot)
            taken = self._waiting.take()
            if taken is None:
                break
            found.append(taken[0])
            size += size_of(taken[0])
        return found

    def _write(self, batch: list[Item]) -> None:
        data = pickle.dumps(batch, protocol=pickle.HIGHEST_PROTOCOL)
        left = memoryview(len(data).to_bytes(LENGTH, "big") + data)
        while left:
            self._since = time.monotonic()
            left = left[os.write(self._pipe, left) :]
        self._since = None
