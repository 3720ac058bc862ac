"""A bounded buffer between the thread that reads a source and the event loop; the newest wins. No I/O."""

import threading
from collections import deque

from lockstep.robot_bridge.link.sending.outgoing_queues import StreamQueue
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
        self._lock = threading.Lock()
        self._words: deque[Said] = deque(maxlen=MOST_WORDS)
        self._media: StreamQueue[Captured] = StreamQueue()

    @property
    def dropped(self) -> int:
        return self._media.dropped

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
        depth = {"pcm_s16le": MOST_SOUND, "h264": MOST_DEPENDENT}.get(medium.codec, 1)
        if medium.codec == "h264" and medium.keyframe:
            depth = 1
        keyframe = medium.keyframe or medium.codec != "h264"
        self._media.put(keyframe=keyframe, depth=depth, make=lambda: medium)

    def take(self) -> list[Said]:
        """Return everything in the buffer, media last."""
        with self._lock:
            words = list(self._words)
            self._words.clear()
            return [*words, *self._media.take_all()]
