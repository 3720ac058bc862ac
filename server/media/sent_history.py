"""What a sender has sent, for retransmission (RFC 4585 6.2.1). No clock is read here."""

from bisect import bisect_right
from collections import deque
from typing import NamedTuple

__all__ = ["SentFrame", "SentHistory"]

RETRANSMIT_BURST = 200  # packets
RETRANSMIT_RATE = 1000.0  # packets per second; a peer's NACKs cannot make the server flood it
KEEP_SECONDS = 2.5  # a path over a satellite needs 0.6 s for one try, and may lose that one too
KEEP_PACKETS = 4096
KEEP_BYTES = 3_000_000
REPEATED = 1024  # packets of which the last retransmission is remembered


class SentFrame(NamedTuple):
    """The packets of one frame: number `first` to `first + len(payloads) - 1`, counted from 0 and never wrapping."""

    first: int
    payloads: list[bytes]
    extension: bytes  # the whole extension block, stamp included
    timestamp: int  # RTP
    marker: bool
    octets: int  # of all payloads
    sent_at: float  # s, on any clock


class SentHistory:
    """The last packets, bounded by time, number and bytes; kept by frame: payloads are shared with all other peers."""

    def __init__(self) -> None:
        self._frames: deque[SentFrame] = deque()
        self._next = 0
        self._bytes = 0
        self._budget = float(RETRANSMIT_BURST)
        self._budget_at = 0.0
        self._repeated: dict[int, float] = {}  # number to the time of its last retransmission, oldest first

    def append(self, frame: SentFrame) -> None:
        frames = self._frames
        frames.append(frame)
        self._next = frame.first + len(frame.payloads)
        self._bytes += frame.octets
        oldest = frames[0]
        while len(frames) > 1 and (
            frame.sent_at - oldest.sent_at > KEEP_SECONDS
            or self._next - oldest.first > KEEP_PACKETS
            or self._bytes > KEEP_BYTES
        ):
            self._bytes -= oldest.octets
            frames.popleft()
            oldest = frames[0]

    def find(self, sequence_number: int, origin: int) -> tuple[SentFrame, int] | None:
        """The frame and index of the packet with this 16-bit number, where packet 0 had `origin`; None if forgotten."""
        age = (origin + self._next - 1 - sequence_number) & 0xFFFF
        number = self._next - 1 - age
        if not self._frames or number < self._frames[0].first:
            return None
        frame = self._frames[bisect_right(self._frames, number, key=lambda frame: frame.first) - 1]
        return frame, number - frame.first

    def on_its_way(self, number: int, now: float, round_trip: float) -> bool:
        """Whether packet `number` was sent again less than a round trip ago: the peer cannot have it yet."""
        again = self._repeated.get(number)
        return again is not None and 0 <= now - again < round_trip

    def spend(self, number: int, now: float) -> bool:
        """Whether one more packet may be retransmitted now; if so, that `number` is."""
        passed = max(0.0, now - self._budget_at)  # a wall clock may be set back
        self._budget = min(RETRANSMIT_BURST, self._budget + passed * RETRANSMIT_RATE)
        self._budget_at = now
        if self._budget < 1:
            return False
        self._budget -= 1
        self._repeated.pop(number, None)
        self._repeated[number] = now
        if len(self._repeated) > REPEATED:
            del self._repeated[next(iter(self._repeated))]
        return True
