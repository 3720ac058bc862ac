"""The bytes in flight, and whether more may leave (RFC 9260 6.1 A to D)."""

from lockstep.rtc.sctp.sending.congestion import CongestionWindow
from lockstep.rtc.sctp.sending.outgoing import Outgoing
from lockstep.rtc.sctp.settings import SctpSettings

__all__ = ["SendWindow"]


class SendWindow:
    """What the network, the peer and a burst admit. Newest-wins chunks have a floor of their own, so that they wait for
    nothing else."""

    def __init__(self, settings: SctpSettings) -> None:
        self.congestion = CongestionWindow(settings)
        self.flight = 0  # bytes
        self.newest_flight = 0  # those of newest-wins chunks
        self.peer_window = 0  # bytes that the peer still takes
        self._burst = 0  # bytes of reliable messages that may leave before the next acknowledgement or timer
        self._largest_burst = settings.max_burst * settings.max_packet
        self._newest_floor = settings.newest_wins_floor * settings.max_packet
        self._floor = settings.window_floor * settings.max_packet

    def begin_burst(self) -> None:
        """Let reliable messages leave in a row (RFC 9260 6.1 D), because something has happened."""
        self._burst = self._largest_burst

    def admits(self, size: int) -> bool:
        """True if a chunk may leave that is not newest-wins (RFC 9260 6.1 A, B and D)."""
        if not self.flight:
            return True  # A: one chunk may always be in flight, also into a closed window
        if self._burst <= 0 or size > self.peer_window:
            return False
        return self.flight < self.congestion.size or self.flight - self.newest_flight < self._floor

    def admits_newest(self, size: int) -> bool:
        """True if a newest-wins message may leave."""
        if self.newest_flight >= self._newest_floor and self.flight >= self.congestion.size:
            return False
        return not self.flight or size <= self.peer_window

    def left(self, chunk: Outgoing) -> None:
        """Note that a chunk is in flight."""
        size = chunk.size
        self.flight += size
        self.peer_window -= size
        if chunk.newest_wins:
            self.newest_flight += size
        else:
            self._burst -= size

    def landed(self, chunk: Outgoing) -> None:
        """Note that a chunk is not in flight any more."""
        self.flight -= chunk.size
        self.peer_window += chunk.size  # 6.2.1 C
        if chunk.newest_wins:
            self.newest_flight -= chunk.size
