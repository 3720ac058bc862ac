"""Queues of messages for a peer that cannot take more: newest wins, per kind of message or per stream. No I/O.

A picture replaces the one that waits. Sound keeps a few segments in order, since each lost one is heard. Pictures that
need earlier ones to be decoded (h264) wait in order too; if they no longer fit, all of them go and the stream resumes
with the next keyframe.
"""

from collections import Counter, deque
from collections.abc import Callable
from typing import Generic, TypeVar

from lockstep.protocol.messages import Media

__all__ = ["MediaOutbox", "NewestOutbox", "StreamQueue"]

Key = TypeVar("Key")
Item = TypeVar("Item")

SOUND = ("pcm_s16le", "opus")
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


class StreamQueue(Generic[Item]):
    """Waiting media of one stream: bounded, and nothing leaves that cannot be decoded."""

    def __init__(self) -> None:
        self.dropped = 0
        self._items: deque[Item] = deque()
        self._is_broken = False  # until a keyframe

    def __len__(self) -> int:
        return len(self._items)

    def put(self, *, keyframe: bool, depth: int, make: Callable[[], Item]) -> bool:
        """Add a medium; `make` builds the item unless it is dropped at once. False: a keyframe is needed now.

        A keyframe replaces the oldest beyond `depth`. Another picture that does not fit takes all that wait with it:
        the stream resumes with the next keyframe.
        """
        if not keyframe and (self._is_broken or len(self._items) >= depth):
            if not self._is_broken:
                self._is_broken = True
                self._drop(len(self._items))
            self.dropped += 1
            return False
        if keyframe:
            self._is_broken = False
            self._drop(len(self._items) - depth + 1)
        self._items.append(make())
        return True

    def pop(self) -> Item:
        return self._items.popleft()

    def take_all(self) -> list[Item]:
        found = list(self._items)
        self._items.clear()
        return found

    def _drop(self, count: int) -> None:
        for _ in range(count):
            self._items.popleft()
            self.dropped += 1


class MediaOutbox(Generic[Item]):
    """Waiting media of one peer. `Item` is the message or its bytes."""

    def __init__(self) -> None:
        self._streams: dict[
            tuple[str, bool], StreamQueue[Item]
        ] = {}  # by stream, and whether it is its second encoding

    def __len__(self) -> int:
        return sum(map(len, self._streams.values()))

    @property
    def drops(self) -> Counter[str]:
        """How many media of each stream were dropped."""
        found: Counter[str] = Counter()
        for (stream, _), queue in self._streams.items():
            if queue.dropped:
                found[stream] += queue.dropped
        return found

    def put(self, media: Media, make: Callable[[], Item]) -> bool:
        """Add a medium; `make` builds the item unless it is dropped at once. False: the stream needs a keyframe."""
        depth = 1 if media.keyframe and media.codec not in SOUND else ORDERED_DEPTH
        return self._streams.setdefault((media.stream, media.second), StreamQueue()).put(
            keyframe=media.keyframe, depth=depth, make=make
        )

    def pop(self) -> Item | None:
        """Return the next item, streams in turn, second encodings last; None if the outbox is empty."""
        waiting = [key for key, queue in self._streams.items() if queue]
        if not waiting:
            return None
        key = next((key for key in waiting if not key[1]), waiting[0])
        queue = self._streams[key] = self._streams.pop(key)  # to the end of the turn
        return queue.pop()
