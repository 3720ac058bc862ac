"""Queues of messages for a peer that cannot take more: newest wins, per kind of message or per stream. No I/O.

A picture replaces the one that waits. Sound keeps a few segments in order, since each lost one is heard. Pictures that
need earlier ones to be decoded (h264) wait in order too; if they no longer fit, all of them go and the stream resumes
with the next keyframe.
"""

from collections import Counter, deque
from collections.abc import Callable
from typing import Generic, TypeVar

from lockstep.protocol.messages import Media

__all__ = ["MediaOutbox", "NewestOutbox"]

Key = TypeVar("Key")
Item = TypeVar("Item")

ORDERED_DEPTH = 10  # segments or dependent pictures of a stream that may wait: 200 ms of sound


class NewestOutbox(Generic[Key, Item]):
    """At most one waiting item per key. A newer one waits behind all others, so that no order of keys is reversed."""

    def __init__(self) -> None:
        self._items: dict[Key, Item] = {}
        self.drops: Counter[Key] = Counter()

    def __len__(self) -> int:
        return len(self._items)

    def put(self, key: Key, item: Item) -> None:
        if key in self._items:
            self.drops[key] += 1
            del self._items[key]
        self._items[key] = item

    def pop(self) -> Item | None:
        """Return the item whose key has waited longest; None if the outbox is empty."""
        return self._items.pop(next(iter(self._items))) if self._items else None


class MediaOutbox(Generic[Item]):
    """Waiting media of one peer. `Item` is the message or its bytes."""

    def __init__(self) -> None:
        self._streams: dict[str, deque[Item]] = {}
        self._broken: set[str] = set()  # streams that wait for a keyframe
        self.drops: Counter[str] = Counter()

    def __len__(self) -> int:
        return sum(map(len, self._streams.values()))

    def put(self, media: Media, make: Callable[[], Item]) -> None:
        """Add a medium; `make` builds the item unless it is dropped at once."""
        queue = self._streams.setdefault(media.stream, deque())
        if media.keyframe:
            self._broken.discard(media.stream)
        elif media.stream in self._broken:
            self.drops[media.stream] += 1
            return
        depth = 1 if media.keyframe and media.codec != "pcm_s16le" else ORDERED_DEPTH
        if media.keyframe:
            while len(queue) >= depth:
                self._drop(media.stream, queue)
        elif len(queue) >= depth:
            self._broken.add(media.stream)
            self.drops[media.stream] += len(queue) + 1
            queue.clear()
            return
        queue.append(make())

    def _drop(self, stream: str, queue: deque[Item]) -> None:
        queue.popleft()
        self.drops[stream] += 1

    def pop(self) -> Item | None:
        """Return the next item, streams in turn; None if the outbox is empty."""
        for stream, queue in self._streams.items():
            if queue:
                self._streams[stream] = self._streams.pop(stream)  # to the end of the turn
                return queue.popleft()
        return None
