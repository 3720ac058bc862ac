"""A queue between a live source and a reader that may be slow: bounded, newest wins, drops counted."""

import asyncio
from collections import deque
from typing import Generic, TypeVar

__all__ = ["NewestQueue", "QueueClosed"]

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
