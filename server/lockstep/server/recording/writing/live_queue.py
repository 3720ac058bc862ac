"""The queue between the console's loop and the thread of a live viewer: bounded in items and bytes, newest first.

One thread puts, another takes, and neither waits for the other: each field is written by one of them alone.
"""

from collections import deque

from lockstep.server.recording.format.topics import PICTURE_FORMATS
from lockstep.server.recording.writing.queue_items import FeedbackItem, Item, MediaItem, RobotItem

__all__ = ["MAX_BYTES", "MAX_ITEMS", "LiveQueue", "size_of"]

MAX_ITEMS = 512  # about 2 s
MAX_BYTES = 32_000_000  # 2 s at 128 Mbit/s
ITEM_BYTES = 2_000  # of an item without data
NUMBER_BYTES = 32  # of a number in a list


class LiveQueue:
    """A full queue drops its oldest items. After a dropped picture, those of its camera are left out up to a keyframe.

    Attributes:
        dropped_media: whether a picture or sound was dropped since somebody last set this to False
        dropped_robot: likewise, of the robot
    """

    def __init__(self, max_items: int = MAX_ITEMS, max_bytes: int = MAX_BYTES) -> None:
        self.dropped_media = False
        self.dropped_robot = False
        self._max_items, self._max_bytes = max_items, max_bytes
        self._waiting: deque[tuple[int, Item, bool]] = deque()
        self._put, self._put_bytes = 0, 0
        self._dropped, self._dropped_bytes = 0, 0
        self._holes: dict[str, int] = {}  # number of the newest picture that was dropped, by camera
        self._taken_bytes = 0
        self._left_out = 0
        self._keyframes: dict[str, int] = {}  # number of the newest one that was taken, by camera

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def dropped(self) -> int:
        """The number of items that were dropped, or left out up to a keyframe."""
        return self._dropped + self._left_out

    @property
    def waiting_bytes(self) -> int:
        """About the memory that the waiting items take."""
        return self._put_bytes - self._dropped_bytes - self._taken_bytes

    def put(self, item: Item, *, repeats: bool = False) -> None:
        """Put an item. `repeats`: it is no news, which `take` returns with it."""
        size = size_of(item)
        while len(self._waiting) >= self._max_items or self.waiting_bytes + size > self._max_bytes:
            if not self._drop_oldest():
                break
        self._put += 1
        self._put_bytes += size
        self._waiting.append((self._put, item, repeats))

    def take(self) -> tuple[Item, bool] | None:
        """Return the oldest item that can be used; None: nothing waits."""
        while self._waiting:
            try:
                number, item, repeats = self._waiting.popleft()
            except IndexError:  # it has just been dropped
                return None
            self._taken_bytes += size_of(item)
            if self._is_whole(number, item):
                return item, repeats
            self._left_out += 1
        return None

    def _drop_oldest(self) -> bool:
        try:
            number, item, _ = self._waiting.popleft()
        except IndexError:
            return False
        self._dropped += 1
        self._dropped_bytes += size_of(item)
        if isinstance(item, MediaItem):
            self.dropped_media = True
            self._holes[item.stream] = number
        elif isinstance(item, RobotItem):
            self.dropped_robot = True
        return True

    def _is_whole(self, number: int, item: Item) -> bool:
        """Return whether a picture can be decoded: none was dropped since the keyframe that it builds on."""
        if not isinstance(item, MediaItem) or item.codec not in PICTURE_FORMATS:
            return True
        if item.keyframe:
            self._keyframes[item.stream] = number
            return True
        return self._holes.get(item.stream, 0) <= self._keyframes.get(item.stream, 0)


def size_of(item: Item) -> int:
    """Return about how much memory an item takes, in bytes."""
    match item:
        case MediaItem(data=data):
            return ITEM_BYTES + len(data)
        case FeedbackItem(feedback=feedback):
            lists = (feedback.axes, feedback.goals, feedback.joints, feedback.ranges)
            return ITEM_BYTES + NUMBER_BYTES * sum(map(len, lists))
        case _:
            return ITEM_BYTES
