"""The number of bytes that may be unacknowledged (RFC 9260 7.2)."""

from lockstep.rtc.sctp.settings import SctpSettings

__all__ = ["CongestionWindow"]


class CongestionWindow:
    """Slow start, congestion avoidance and fast recovery. TSNs are unwrapped."""

    def __init__(self, settings: SctpSettings) -> None:
        self._packet = settings.max_packet
        self._partial = 0  # bytes acknowledged since the window last grew
        self._recovery_ends: int | None = None  # the TSN whose acknowledgement ends the recovery
        self.size = settings.initial_window * settings.max_packet
        self.threshold = settings.receive_window  # ssthresh; RFC 9260 7.2.1 lets it begin as high as one likes

    def acknowledged(self, size: int, was_full: bool, cumulative: int) -> None:
        """Note that `size` more bytes have arrived, and everything up to `cumulative`; the window `was_full` before."""
        if self._recovery_ends is not None:
            if cumulative >= self._recovery_ends:
                self._recovery_ends = None
            return
        if not was_full:
            return  # 7.2.1: only a window that is used grows
        if self.size <= self.threshold:
            self.size += min(size, self._packet)
            return
        self._partial += size  # 7.2.2
        if self._partial >= self.size:
            self._partial -= self.size
            self.size += self._packet

    def lost(self, highest: int) -> None:
        """Note a missing chunk; `highest` is the last one sent. Once in a recovery (7.2.4)."""
        if self._recovery_ends is None:
            self._recovery_ends = highest
            self._halve()
            self.size = self.threshold

    def expired(self) -> None:
        """Note that nothing came back at all, twice (7.2.3). `SctpSettings.window_floor` is the sender's."""
        self._halve()
        self._recovery_ends = None
        self.size = self._packet

    def _halve(self) -> None:
        self.threshold = max(self.size // 2, 4 * self._packet)
        self._partial = 0
