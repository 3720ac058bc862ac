"""The stage that spreads packets in time: a keyframe that leaves at once fills the queues on its path."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from lockstep.rtc.rtp.stage import PacketsLeft, Stage
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["Pacer", "PacerSettings", "PathBudget"]


@dataclass(frozen=True, slots=True)
class PacerSettings:
    burst: int = 15_000  # bytes that may leave at once: an ordinary picture never waits
    free_rate: float = 20_000_000.0  # bit/s towards a peer whose path has shown no limit
    headroom: float = 2.5  # times the rate that the path is believed to carry
    waiting: int = 4096  # packets; further ones are dropped, and the peer will ask for them
    least_wait: float = 0.001  # s between two looks; timers are no finer


class PathBudget:
    """The bytes that may leave for one peer, shared by the pacers of its streams."""

    def __init__(self, settings: PacerSettings | None = None) -> None:
        self.settings = settings or PacerSettings()
        self._bucket = TokenBucket(self.settings.free_rate / 8, self.settings.burst)  # of bytes

    def limit(self, bitrate: float | None) -> None:
        """Limit the rate to a path that is believed to carry `bitrate` (bit/s); None: no limit was seen."""
        settings = self.settings
        self._bucket.rate = (settings.free_rate if bitrate is None else bitrate * settings.headroom) / 8

    def take(self, octets: int, now: float) -> bool:
        """Return True if a packet may leave. The last one may overdraw, so that any size passes some time."""
        return self._bucket.overdraw(octets, now)

    def wait(self, now: float) -> float:
        """Return the time in s until something may leave again."""
        return max(self.settings.least_wait, self._bucket.wait(now, level=0.0))


class Pacer(Stage):
    """Holds packets back in their order; retransmissions go first. Sound does not pass it: it never waits."""

    def __init__(self, following: Stage, budget: PathBudget) -> None:
        super().__init__(following)
        self.dropped = 0  # packets that found no room
        self._budget = budget
        self._repairs: deque[RtpPacket] = deque()
        self._packets: deque[RtpPacket] = deque()
        self._due: float | None = None

    @property
    def holds(self) -> bool:
        """True while packets wait here; `PacketsLeft` follows."""
        return self._due is not None

    def rtp(self, packet: RtpPacket, now: float) -> None:
        if len(self._repairs) + len(self._packets) >= self._budget.settings.waiting:
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
        self._due = now + self._budget.wait(now) if self._repairs or self._packets else None

    def _admitted(self, now: float) -> Iterator[RtpPacket]:
        for waiting in (self._repairs, self._packets):
            while waiting:
                if not self._budget.take(len(waiting[0].payload), now):
                    return
                yield waiting.popleft()
