"""Bounds how many of a peer's messages are read before others have their turn.

No I/O, no clock: the caller hands in `now`.
"""

__all__ = ["MessageRate"]

MESSAGE_BYTES = 1024  # a message of this size counts as two, and so on: reading it costs as much


class MessageRate:
    """A token bucket of messages: ask `left` before each, `spend` after it, and `wait` if none is left.

    Attributes:
        rate: messages per second; may be changed
    """

    def __init__(self, rate: float, burst: float, now: float) -> None:
        """`rate`: messages per second; `burst`: messages at once."""
        self.rate = rate
        self._burst = burst
        self._tokens = burst
        self._filled = now

    def refill(self, now: float) -> None:
        self._tokens = min(self._burst, self._tokens + max(0.0, now - self._filled) * self.rate)
        self._filled = now

    @property
    def left(self) -> bool:
        """True if another message may be read."""
        return self._tokens > 0

    def spend(self, size: int) -> None:
        """Count a message of `size` bytes as read."""
        self._tokens -= 1 + size / MESSAGE_BYTES

    def wait(self) -> float:
        """Return the seconds until some messages may be read at once again: a tenth of the burst."""
        return max(0.0, (self._burst / 10 - self._tokens) / self.rate)
