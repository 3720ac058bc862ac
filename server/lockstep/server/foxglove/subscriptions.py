"""The subscriptions of all viewers, counted in the SDK's threads and looked at on the loop."""

import threading
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from lockstep.server.recording.format.topics import stream_of

__all__ = ["Subscribers", "Subscriptions"]


class Subscribers(NamedTuple):
    """The topics that viewers have subscribed to now."""

    any: bool  # somebody subscribed to something
    media: bool  # somebody subscribed to a camera or a microphone
    newcomer: bool  # somebody subscribed since the last look
    media_newcomer: bool  # and to a camera or a microphone


class Subscriptions:
    """Call `change` from any thread, and `look` after each `wake`.

    Between two looks it wakes once: viewers who subscribe without end cost the loop no more than one who does it once.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake = wake
        self._lock = threading.Lock()
        self._counts: Counter[str] = Counter()  # by topic
        self._newcomer = self._media_newcomer = self._woken = False

    def change(self, topic: str, change: int) -> None:
        """Somebody subscribed to a topic (+1), or no longer is (-1)."""
        with self._lock:
            self._counts[topic] += change
            if change > 0:
                self._newcomer = True
                self._media_newcomer |= bool(stream_of(topic))
            wake, self._woken = not self._woken, True
        if wake:
            self._wake()

    def look(self) -> Subscribers:
        with self._lock:
            wanted = [topic for topic, count in self._counts.items() if count > 0]
            found = Subscribers(
                bool(wanted), any(map(stream_of, wanted)), bool(wanted) and self._newcomer, self._media_newcomer
            )
            self._newcomer = self._media_newcomer = self._woken = False
        return found
