"""Pictures that build on each other, kept from the last keyframe on, so that decoding can begin at any time. No I/O."""

from collections import deque

from lockstep.protocol.messages import Media

__all__ = ["GroupOfPictures"]

MOST_PICTURES = 900  # 30 s at 30 a second
MOST_BYTES = 16_000_000


class GroupOfPictures:
    """The pictures since the last keyframe. When one does not fit, all are dropped until the next keyframe."""

    def __init__(self) -> None:
        self._waiting: deque[Media] = deque()  # not decoded yet
        self._bytes = 0
        self._broken = True  # until a keyframe

    def add(self, media: Media) -> None:
        if media.keyframe:
            self._clear()
            self._broken = False
        elif self._broken:
            return
        elif len(self._waiting) >= MOST_PICTURES or self._bytes + len(media.payload) > MOST_BYTES:
            self._clear()
            self._broken = True
            return
        self._waiting.append(media)
        self._bytes += len(media.payload)

    def take(self) -> tuple[Media, ...]:
        """Return the pictures to decode, in order, for the newest one; empty while that is not possible."""
        found = tuple(self._waiting)
        self._clear()
        return found

    def _clear(self) -> None:
        self._waiting.clear()
        self._bytes = 0
