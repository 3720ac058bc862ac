"""The queue between the console's loop and the thread that writes a recording: bounded, and full it loses the newest.

The loop puts, the thread takes, and neither waits for the other.
"""

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from lockstep.server.recording.format.records import EpisodeRecord
from lockstep.server.recording.writing.live_queue import size_of
from lockstep.server.recording.writing.queue_items import Item, OwnItem

__all__ = ["Lost", "RecordingQueue"]

MAX_WAITING = 4096  # items, 15 s and more
MAX_BYTES = 128_000_000  # of the waiting items, about: 15 s at 68 Mbit/s


class Lost(NamedTuple):
    """Stands in the queue where items were left out."""

    items: int


class RecordingQueue:
    """When the disk is too slow, items are left out and counted. Each field is written by the loop or by the thread.

    Attributes:
        lost: number of the items that were left out
    """

    def __init__(self) -> None:
        self.lost = 0  # by the loop
        self._waiting: deque[Item | Lost] = deque()  # a `Lost` has the number of all that were lost before it
        self._put_bytes = 0  # by the loop
        self._marked = 0  # by the loop: `lost` at the last `Lost` in the queue
        self._taken_bytes = 0  # by the thread
        self._told = 0  # by the thread: how many of `lost` it was told of

    def put(self, item: Item) -> None:
        """Queue an item without blocking, or leave it out.

        The begin and the end of an episode always find a place: a person has caused each of them, and the end decides.
        They come a few times a second at most. Marks do not: stops and changes of the seat cause them too.
        """
        decides = isinstance(item, OwnItem) and isinstance(item.record, EpisodeRecord) and item.record.kind != "mark"
        size = size_of(item)
        is_full = len(self._waiting) >= MAX_WAITING or (self._waiting and self._waiting_bytes + size > MAX_BYTES)
        if is_full and not decides:
            self.lost += 1
            return
        if self._marked != self.lost:  # what was left out has its place in front of what follows
            self._marked = self.lost
            self._waiting.append(Lost(self.lost))
        self._put_bytes += size
        self._waiting.append(item)

    def take(self) -> Iterator[Item | Lost]:
        """Yield what waits now. An item takes its room until the next one is asked for."""
        for _ in range(len(self._waiting)):
            item = self._waiting.popleft()
            if not isinstance(item, Lost):
                yield item
                self._taken_bytes += size_of(item)
            elif lost := self._tell(item.items):
                yield Lost(lost)

    def take_lost(self) -> int:
        """Return the number of items that were left out behind all others, once; 0 while something waits."""
        return 0 if self._waiting else self._tell(self.lost)

    def _tell(self, lost: int) -> int:
        untold, self._told = lost - self._told, max(self._told, lost)
        return max(0, untold)

    @property
    def waiting(self) -> float:
        """The share of the queue that is taken, 0 to 1."""
        return min(1.0, max(len(self._waiting) / MAX_WAITING, self._waiting_bytes / MAX_BYTES))

    @property
    def _waiting_bytes(self) -> int:
        return self._put_bytes - self._taken_bytes
