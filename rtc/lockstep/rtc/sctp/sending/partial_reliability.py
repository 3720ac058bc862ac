"""Messages that are given up, and how the peer is told (RFC 3758 3.5, RFC 8260 2.3.1)."""

from collections import Counter

from lockstep.rtc.sctp.sending.fragmentation import WHOLE, Fragmentation
from lockstep.rtc.sctp.sending.outgoing import ABANDONED, ACKNOWLEDGED, IN_FLIGHT, Outgoing
from lockstep.rtc.sctp.sending.outstanding import Outstanding
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.sending.send_window import SendWindow
from lockstep.rtc.sctp.serial import MASK_16, MASK_32
from lockstep.rtc.sctp.wire.chunks import UNORDERED, ForwardTsn, InterleavedForwardTsn, Skip
from lockstep.rtc.sctp.wire.packet import COMMON_HEADER

__all__ = ["PartialReliability"]


class PartialReliability:
    """Gives up messages, and says so in FORWARD TSN chunks, the next of them at `forward_at`."""

    def __init__(
        self,
        fragmentation: Fragmentation,
        outstanding: Outstanding,
        window: SendWindow,
        round_trip: RoundTrip,
        max_packet: int,
        counts: Counter[str],
    ) -> None:
        self.agreed = False  # True: the peer has it; without, every message is reliable (RFC 3758 3.3.1)
        self.forward_at: float | None = None
        self._fragmentation = fragmentation
        self._outstanding = outstanding
        self._window = window
        self._round_trip = round_trip
        self._room = max_packet - COMMON_HEADER - 8  # bytes of a FORWARD TSN for the streams that it names
        self._counts = counts
        # Everything up to this TSN has arrived or was given up (Advanced.Peer.Ack.Point, RFC 3758 3.5).
        self._advanced = outstanding.acknowledged
        self._skips: dict[tuple[int, bool], int] = {}  # the last message given up, by stream and order

    def gives_up(self, chunk: Outgoing, now: float) -> bool:
        """True if the message of a lost chunk is not to be repeated; it is given up then."""
        message = chunk.message
        if self.agreed and (
            (message.max_retransmits is not None and chunk.sent_count > message.max_retransmits)
            or (message.expires is not None and now >= message.expires)
        ):
            self._abandon(chunk)
            return True
        return False

    def _abandon(self, chunk: Outgoing) -> None:
        """Give up the whole message, also its unsent part (RFC 3758 3.5 A3)."""
        message = chunk.message
        message.abandoned = True
        self._counts["abandoned"] += 1
        for each in message.chunks or (chunk,):
            if each.state is IN_FLIGHT:
                self._window.landed(each)
            if each.state is not ACKNOWLEDGED:
                each.state = ABANDONED
                each.payload = b""
        if message.chunks and message.taken < len(message.payload):
            self._outstanding.chunks.append(self._fragmentation.abandoned_rest(message, chunk.flags & UNORDERED))

    def advance(self, now: float) -> None:
        """Move the point up to which everything has arrived or was given up (RFC 3758 3.5 C2).

        It passes single messages that the peer has, so that one FORWARD TSN tells of all holes. It stops at fragments
        of a message that is not given up: a peer would drop those.
        """
        acknowledged = self._outstanding.acknowledged
        if self._advanced <= acknowledged:
            self._advanced = acknowledged
        outstanding, skips = self._outstanding.chunks, self._skips
        moved = False
        while outstanding:
            chunk = outstanding[0]
            if chunk.state is ABANDONED:
                key = chunk.message.stream, bool(chunk.flags & UNORDERED)
                if self._fragmentation.interleaving or not key[1]:
                    if key not in skips and len(skips) >= self._most_skips:
                        break
                    skips[key] = max(chunk.message.sequence, skips.get(key, 0))
                moved = True
            elif self._advanced == acknowledged or not _is_done_with(chunk):
                break
            outstanding.popleft()
            self._advanced = chunk.tsn
        if acknowledged >= self._advanced:
            skips.clear()
            self.forward_at = None
        elif moved:
            self.forward_at = now

    @property
    def _most_skips(self) -> int:
        """The number of streams that fit into one FORWARD TSN."""
        return self._room // (8 if self._fragmentation.interleaving else 4)

    def forward_tsn(self, now: float) -> ForwardTsn | InterleavedForwardTsn | None:
        """Return the chunk that tells the peer of messages that were given up, when it is due (RFC 3758 3.5)."""
        if self.forward_at is None or now < self.forward_at:
            return None
        self.forward_at = now + self._round_trip.timeout(1)
        skips = [Skip(stream, last, unordered) for (stream, unordered), last in self._skips.items()]
        cumulative = self._advanced & MASK_32
        if self._fragmentation.interleaving:
            return InterleavedForwardTsn(
                cumulative, [Skip(skip.stream, skip.sequence & MASK_32, skip.unordered) for skip in skips]
            )
        return ForwardTsn(cumulative, [Skip(skip.stream, skip.sequence & MASK_16) for skip in skips])

    def reset(self, streams: tuple[int, ...]) -> None:
        """Forget what was given up on these streams: the peer has reset them (RFC 6525 5.2.7)."""
        for stream in streams:
            for unordered in (False, True):
                self._skips.pop((stream, unordered), None)

    def clear(self) -> None:
        self._skips.clear()
        self.forward_at = None


def _is_done_with(chunk: Outgoing) -> bool:
    """True if the peer has the chunk, and keeps no fragment of a message because of it."""
    is_whole = chunk.flags & WHOLE == WHOLE
    return chunk.state is ACKNOWLEDGED and (is_whole or chunk.message.abandoned)
