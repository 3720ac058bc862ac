"""The stage that spreads packets in time: a keyframe that leaves at once fills the queues on its path."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from lockstep.rtc.rtp.packet import RtpPacket
from lockstep.rtc.rtp.stage import PacketsLeft, Stage

__all__ = ["Pacer", "PacerSettings", "TokenBucket"]


@dataclass(frozen=True, slots=True)
class PacerSettings:
    burst: int = 15_000  # bytes that may leave at once: an ordinary picture never waits
    free_rate: float = 20_000_000.0  # bit/s towards a peer whose path has shown no limit
    headroom: float = 2.5  # times the rate that the path is believed to carry
    waiting: int = 4096  # packets; further ones are dropped, and the peer will ask for them
    least_wait: float = 0.001  # s between two looks; timers are no finer


class TokenBucket:
    """The bytes that may leave for one peer, shared by the pacers of its streams."""

    def __init__(self, settings: PacerSettings | None = None) -> None:
        self.settings = settings or PacerSettings()
        self._rate = self.settings.free_rate / 8  # bytes/s
        self._tokens = float(self.settings.burst)
        self._at: float | None = None

    def limit(self, bitrate: float | None) -> None:
        """Limit the rate to a path that is believed to carry `bitrate` (bit/s); None: no limit was seen."""
        settings = self.settings
        self._rate = (settings.free_rate if bitrate is None else bitrate * settings.headroom) / 8

    def take(self, octets: int, now: float) -> bool:
        """Return True if a packet may leave. The last one may overdraw, so that any size passes some time."""
        if self._at is not None:
            self._tokens = min(float(self.settings.burst), self._tokens + (now - self._at) * self._rate)
        self._at = now
        if self._tokens <= 0:
            return False
        self._tokens -= octets
        return True

    def wait(self) -> float:
        """Return the time in s after the last `take` until something may leave again."""
        return max(self.settings.least_wait, -self._tokens / self._rate)


class Pacer(Stage):
    """Holds packets back in their order; retransmissions go first. Sound does not pass it: it never waits."""

    def __init__(self, following: Stage, bucket: TokenBucket) -> None:
        super().__init__(following)
        self.dropped = 0  # packets that found no room
        self._bucket = bucket
        self._repairs: deque[RtpPacket] = deque()
        self._packets: deque[RtpPacket] = deque()
        self._due: float | None = None

    @property
    def holds(self) -> bool:
        """True while packets wait here; `PacketsLeft` follows."""
        return self._due is not None

    def rtp(self, packet: RtpPacket, now: float) -> None:
        if len(self._repairs) + len(self._packets) >= self._bucket.settings.waiting:
            self.dropped += 1
            return
        (self._repairs if packet.is_repair else self._packets).append(packet)
        self._let_out(now)

    def due(self) -> float | None:
        return self._due

    def handle_timer(self, now: float) -> None:
        if self._due is not None and now >= self._due:
            self._let_out(now)
            if not self.holds:
                self.event(PacketsLeft())
        super().handle_timer(now)

    def _let_out(self, now: float) -> None:
        for packet in self._admitted(now):
            super().rtp(packet, now)
        self._due = now + self._bucket.wait() if self._repairs or self._packets else None

    def _admitted(self, now: float) -> Iterator[RtpPacket]:
        for waiting in (self._repairs, self._packets):
            while waiting:
                if not self._bucket.take(len(waiting[0].payload), now):
                    return
                yield waiting.popleft()
