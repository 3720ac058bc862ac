"""Queues between a live source and readers that may be slow: bounded, newest wins, drops counted."""

import asyncio
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

__all__ = ["NewestQueue", "QueueClosed", "Readers"]

Item = TypeVar("Item")


class QueueClosed(Exception):
    """The queue is closed and empty."""


class NewestQueue(Generic[Item]):
    """A queue for one reader. `put` never blocks and never fails; a full queue loses its oldest item."""

    def __init__(self, bound: int) -> None:
        self.dropped = 0
        self._bound = bound
        self._items: deque[Item] = deque()
        self._closed = False
        self._changed = asyncio.Event()

    def __len__(self) -> int:
        return len(self._items)

    def put(self, item: Item) -> None:
        if self._closed:
            return
        if len(self._items) >= self._bound:
            self._items.popleft()
            self.dropped += 1
        self._items.append(item)
        self._changed.set()

    async def get(self) -> Item:
        """Return the oldest item; wait for one if there is none.

        Raises:
            QueueClosed: the queue was closed and is empty.
        """
        while not self._items:
            if self._closed:
                raise QueueClosed
            self._changed.clear()
            await self._changed.wait()
        return self._items.popleft()

    def clear(self) -> int:
        """Forget all items and return their number."""
        count = len(self._items)
        self._items.clear()
        self.dropped += count
        return count

    def close(self) -> None:
        self._closed = True
        self._changed.set()


class Readers(Generic[Item]):
    """The readers of a source, each with a queue of its own."""

    def __init__(self) -> None:
        self._queues: list[NewestQueue[Item]] = []
        self._unread = 0  # dropped by readers that are gone
        self._closed = False

    def __len__(self) -> int:
        return len(self._queues)

    @contextmanager
    def open(self, bound: int) -> Iterator[NewestQueue[Item]]:
        """Read inside the block. `bound`: items that may wait for this reader."""
        queue: NewestQueue[Item] = NewestQueue(bound)
        if self._closed:
            queue.close()
        self._queues.append(queue)
        try:
            yield queue
        finally:
            self._queues.remove(queue)
            self._unread += queue.dropped

    def put(self, item: Item) -> None:
        for queue in self._queues:
            queue.put(item)

    @property
    def dropped(self) -> int:
        """The items that no reader took in time, of all readers so far."""
        return self._unread + sum(queue.dropped for queue in self._queues)

    def close(self) -> None:
        """Note that no more items will come: readers read the remaining ones, and end."""
        self._closed = True
        for queue in self._queues:
            queue.close()
