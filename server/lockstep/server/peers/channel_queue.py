"""Messages that wait to be sent on one data channel. No I/O.

A channel that has taken everything is written to at once; while bytes are still buffered, messages wait here.
Only the newest feedback is kept. Other messages wait in order up to a bound; then the oldest is dropped and counted.
"""

from collections import deque

__all__ = ["ChannelQueue"]

MAX_WAITING = 160  # a newcomer is told a hundred notes at once


class ChannelQueue:
    def __init__(self, max_waiting: int = MAX_WAITING) -> None:
        self._waiting: deque[str] = deque()
        self._max_waiting = max_waiting
        self._newest: str | None = None  # feedback not yet written
        self.dropped = 0
        self.superseded = 0

    @property
    def empty(self) -> bool:
        return not self._waiting and self._newest is None

    def put(self, text: str) -> None:
        if len(self._waiting) == self._max_waiting:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(text)

    def put_newest(self, text: str) -> None:
        if self._newest is not None:
            self.superseded += 1
        self._newest = text

    def take(self) -> str | None:
        """Return the next text to write, or None."""
        if self._waiting:
            return self._waiting.popleft()
        text, self._newest = self._newest, None
        return text
