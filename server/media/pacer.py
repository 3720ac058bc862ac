"""How fast packets may leave for one peer: a token bucket that spreads keyframes. No clock is read here."""

from collections.abc import Sequence

__all__ = ["Pacer"]

BURST_BYTES = 15_000  # that may leave at once: an ordinary picture never waits
FREE_BPS = 20_000_000  # towards a peer whose path has shown no limit
HEADROOM = 2.5  # times the rate that the path is believed to carry


class Pacer:
    """One per peer, shared by its streams. Sound and control messages do not pass it: they never wait."""

    def __init__(self) -> None:
        self._bytes_per_second = FREE_BPS / 8
        self._tokens = float(BURST_BYTES)
        self._at: float | None = None

    def limit(self, rate_bps: float | None) -> None:
        """The path is believed to carry `rate_bps`; None: no limit was seen."""
        self._bytes_per_second = (FREE_BPS if rate_bps is None else rate_bps * HEADROOM) / 8

    def admit(self, packets: Sequence[bytes], now: float) -> int:
        """How many of these packets may leave now, in their order; they count as sent.

        The last one may overdraw the bucket, so that a packet of any size passes some time.
        """
        if self._at is not None:
            self._tokens = min(BURST_BYTES, self._tokens + (now - self._at) * self._bytes_per_second)
        self._at = now
        total = sum(map(len, packets))
        if self._tokens > total:  # almost always
            self._tokens -= total
            return len(packets)
        for count, packet in enumerate(packets):
            if self._tokens <= 0:
                return count
            self._tokens -= len(packet)
        return len(packets)
