"""What a sender has sent, for retransmission (RFC 4585 6.2.1). No clock is read here."""

from bisect import bisect_right
from collections import deque
from typing import NamedTuple

__all__ = ["SentFrame", "SentHistory"]

RETRANSMIT_BURST = 200  # packets
RETRANSMIT_RATE = 1000.0  # packets per second; a peer's NACKs cannot make the server flood it


class SentFrame(NamedTuple):
    """The packets of one frame: number `first` to `first + len(payloads) - 1`, counted from 0 and never wrapping."""

    first: int
    payloads: list[bytes]
    extension: bytes  # the whole extension block, stamp included
    timestamp: int  # RTP
    marker: bool


class SentHistory:
    """The last `capacity` packets, kept by frame: payloads are shared with all other peers."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._frames: deque[SentFrame] = deque()
        self._next = 0
        self._budget = float(RETRANSMIT_BURST)
        self._budget_at = 0.0

    def append(self, frame: SentFrame) -> None:
        self._frames.append(frame)
        self._next = frame.first + len(frame.payloads)
        while self._next - self._frames[0].first > self._capacity and len(self._frames) > 1:
            self._frames.popleft()

    def find(self, sequence_number: int, origin: int) -> tuple[SentFrame, int] | None:
        """The frame and index of the packet with this 16-bit number, where packet 0 had `origin`; None if forgotten."""
        age = (origin + self._next - 1 - sequence_number) & 0xFFFF
        number = self._next - 1 - age
        if not self._frames or number < self._frames[0].first:
            return None
        frame = self._frames[bisect_right(self._frames, number, key=lambda frame: frame.first) - 1]
        return frame, number - frame.first

    def spend(self, now: float) -> bool:
        """Whether one more packet may be retransmitted now."""
        self._budget = min(RETRANSMIT_BURST, self._budget + (now - self._budget_at) * RETRANSMIT_RATE)
        self._budget_at = now
        if self._budget < 1:
            return False
        self._budget -= 1
        return True
