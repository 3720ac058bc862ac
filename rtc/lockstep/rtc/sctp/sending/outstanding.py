"""The chunks that left, or are to leave, and are not acknowledged up to yet (RFC 9260 6.2.1, 7.2.4)."""

from collections import deque

from lockstep.rtc.sctp.sending.outgoing import ABANDONED, ACKNOWLEDGED, IN_FLIGHT, Outgoing
from lockstep.rtc.sctp.sending.send_window import SendWindow
from lockstep.rtc.sctp.wire.chunks import Sack

__all__ = ["Outstanding"]

MISSES = 3  # reports of a chunk as missing before it is repeated (RFC 9260 7.2.4)


class Outstanding:
    """`chunks` are by TSN, without a hole. Everything up to the TSN `acknowledged` has arrived."""

    def __init__(self, initial_tsn: int, window: SendWindow) -> None:
        self.chunks: deque[Outgoing] = deque()
        self.acknowledged = initial_tsn - 1
        self._window = window
        self._sacks = 0

    def take(self, sack: Sack, cumulative: int) -> list[Outgoing]:
        """Take a SACK, whose cumulative TSN is `cumulative`. Return the chunks that have arrived with it."""
        self._sacks += 1
        arrived: list[Outgoing] = []
        chunks = self.chunks
        while chunks and chunks[0].tsn <= cumulative:
            chunk = chunks.popleft()
            if chunk.state is IN_FLIGHT:
                arrived.append(chunk)
                self._window.landed(chunk)
            chunk.state = ACKNOWLEDGED
        self.acknowledged = cumulative
        if sack.gaps and chunks:
            self._take_gaps(sack, arrived)
        return arrived

    def _take_gaps(self, sack: Sack, arrived: list[Outgoing]) -> None:
        first, last = self.chunks[0].tsn, self.chunks[-1].tsn
        done = self.acknowledged  # everything up to here was looked at, so that overlapping gaps cost nothing
        for start, end in sack.gaps:
            begin = max(self.acknowledged + start, done + 1, first)
            done = max(done, min(self.acknowledged + end, last))
            for tsn in range(begin, done + 1):
                chunk = self.chunks[tsn - first]
                chunk.reported = self._sacks
                if chunk.state is IN_FLIGHT:
                    arrived.append(chunk)
                    self._window.landed(chunk)
                if chunk.sent_count and chunk.state is not ABANDONED:
                    chunk.state = ACKNOWLEDGED

    def missed(self, arrived: list[Outgoing], now: float, reordering: float) -> list[Outgoing]:
        """Count chunks that left before one that has arrived now, and return the lost ones (RFC 9260 7.2.4).

        A repeated chunk may be missed again, by chunks that left after the repeat. Three misses within the path's
        jitter, `reordering` in s, are not a loss yet (as in RFC 8985 6.2).
        """
        once = [chunk for chunk in arrived if chunk.sent_count == 1]
        if not once:
            return []
        highest, latest = max(chunk.tsn for chunk in once), max(chunk.sent_at for chunk in once)
        lost = []
        for chunk in self.chunks:
            if chunk.tsn >= highest:
                break
            if chunk.state is IN_FLIGHT and chunk.sent_at <= latest:
                chunk.misses += 1
                if chunk.misses >= MISSES and now - chunk.sent_at >= reordering:
                    lost.append(chunk)
        return lost

    def was_dropped(self, chunk: Outgoing) -> bool:
        """True if the peer has dropped a chunk that it had acknowledged (RFC 9260 6.2.1 D iii)."""
        return chunk.state is ACKNOWLEDGED and chunk.reported != self._sacks
