"""A bounded buffer between the thread that reads a source and the event loop; the newest wins. No I/O."""

import threading
from collections import deque

from lockstep.server.media.sources.source_wire import Captured, Said

__all__ = ["LatestValue"]

MOST_WORDS = 8  # messages that are not media
MOST_SOUND = 25  # segments
MOST_DEPENDENT = 60  # pictures that build on each other


class LatestValue:
    """Call `put` from one thread, `take` from another.

    Of independent pictures the newest is kept. When pictures that build on each other no longer fit, all of them are
    dropped until the next keyframe.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._lock = threading.Lock()
        self._words: deque[Said] = deque(maxlen=MOST_WORDS)
        self._media: deque[Captured] = deque()
        self._broken = False  # until a keyframe

    def put(self, said: Said) -> bool:
        """Add a message; True if the buffer was empty, so that the reader has to be told."""
        with self._lock:
            empty = not self._words and not self._media
            if isinstance(said, Captured):
                self._keep(said)
            else:
                self._words.append(said)
            return empty and bool(self._words or self._media)

    def _keep(self, medium: Captured) -> None:
        most = {"pcm_s16le": MOST_SOUND, "h264": MOST_DEPENDENT}.get(medium.codec, 1)
        if medium.codec == "h264" and medium.keyframe:
            self._broken = False
            self._forget()
        elif self._broken:
            self.dropped += 1
            return
        elif len(self._media) >= most and medium.codec == "h264":
            self._broken = True
            self._forget()
            self.dropped += 1
            return
        while len(self._media) >= most:
            self._media.popleft()
            self.dropped += 1
        self._media.append(medium)

    def _forget(self) -> None:
        self.dropped += len(self._media)
        self._media.clear()

    def take(self) -> list[Said]:
        """Return everything in the buffer, media last."""
        with self._lock:
            found = [*self._words, *self._media]
            self._words.clear()
            self._media.clear()
            return found
