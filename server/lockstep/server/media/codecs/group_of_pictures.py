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

    def take(self, last: Media) -> tuple[Media, ...]:
        """Return the pictures to decode for `last`, in order, itself the last; empty if that is not possible any more.

        The caller has to decode them: later pictures build on them.
        """
        if not any(each is last for each in self._waiting):
            return ()
        found: list[Media] = []
        while not found or found[-1] is not last:
            found.append(self._waiting.popleft())
            self._bytes -= len(found[-1].payload)
        return tuple(found)

    def _clear(self) -> None:
        self._waiting.clear()
        self._bytes = 0
