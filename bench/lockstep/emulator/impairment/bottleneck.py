"""The slowest link of a path: a rate, and a queue in front of it that drops what does not fit. No I/O."""

__all__ = ["UNBOUNDED", "Bottleneck"]

UNBOUNDED = 1 << 40  # bytes


class Bottleneck:
    """One direction of a bottleneck, shared by everything that passes it.

    Args:
        rate: bits a second
        queue: bytes that may wait or be on their way out; a packet that does not fit is dropped (drop-tail)
    """

    def __init__(self, rate: float, queue: int = UNBOUNDED) -> None:
        self.longest_wait = 0.0  # s that a packet waited before it was sent
        self.total_wait = 0.0  # s
        self.passed = 0
        self.dropped = 0
        self._rate = rate / 8
        self._queue = queue
        self._free_at = 0.0

    def wait(self, now: float) -> float:
        """Return the seconds that a packet arriving now would wait."""
        return max(0.0, self._free_at - now)

    def admit(self, now: float, size: int) -> float | None:
        """Return the time at which the packet's last byte is out; None if the queue is full."""
        waits = self.wait(now)
        if waits * self._rate + size > self._queue:
            self.dropped += 1
            return None
        self.passed += 1
        self.total_wait += waits
        self.longest_wait = max(self.longest_wait, waits)
        self._free_at = now + waits + size / self._rate
        return self._free_at
