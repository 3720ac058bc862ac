"""Turns messages into chunks, and keeps these until acknowledged or given up (RFC 9260 6.1 to 6.3, RFC 3758 3.5)."""

from collections import Counter, deque
from enum import Enum
from heapq import heappop, heappush

from lockstep.rtc.sctp.congestion import CongestionWindow
from lockstep.rtc.sctp.round_trip import RoundTrip
from lockstep.rtc.sctp.send_queue import Message, SendQueue
from lockstep.rtc.sctp.serial import MASK_16, MASK_32, unwrap
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import (
    BEGIN,
    DATA_HEADER,
    END,
    IMMEDIATE,
    INTERLEAVED_HEADER,
    UNORDERED,
    ForwardTsn,
    InterleavedForwardTsn,
    Sack,
    Skip,
    encode_data,
    encode_interleaved,
)
from lockstep.rtc.sctp.wire.packet import COMMON_HEADER

__all__ = ["Outgoing", "Sender"]

WHOLE = BEGIN | END
MISSES = 3  # reports of a chunk as missing before it is repeated (RFC 9260 7.2.4)
REMEMBERED = 256  # repeated TSNs, to know a needless repeat by


class _State(Enum):
    WAITING = 1  # to be sent, for the first time or again
    IN_FLIGHT = 2
    ACKNOWLEDGED = 3
    ABANDONED = 4


_WAITING, _IN_FLIGHT = _State.WAITING, _State.IN_FLIGHT
_ACKNOWLEDGED, _ABANDONED = _State.ACKNOWLEDGED, _State.ABANDONED


class Outgoing:
    """A chunk with a TSN, which lives until everything up to it is acknowledged."""

    __slots__ = (
        "flags",
        "fragment",
        "message",
        "misses",
        "newest_wins",
        "payload",
        "reported",
        "sent_at",
        "sent_count",
        "size",
        "state",
        "tsn",
    )

    def __init__(self, tsn: int, flags: int, message: Message, fragment: int, payload: bytes, newest: bool) -> None:
        self.tsn = tsn  # unwrapped
        self.flags = flags
        self.message = message
        self.fragment = fragment
        self.payload = payload
        self.newest_wins = newest
        self.size = len(payload)
        self.state = _WAITING
        self.sent_at = 0.0
        self.sent_count = 0
        self.misses = 0
        self.reported = 0  # number of the last SACK that named it in a gap block


class Sender:
    """The sending half of an association, from messages to encoded chunks.

    Newest-wins messages leave first and have a window of their own, so that they wait for nothing else. The TSNs of a
    plain message's fragments are consecutive, as RFC 9260 6.9 wants; a chunk that leaves while some of them wait for
    the window has a later one.

    A chunk that nothing acknowledges in time is lost. The first time that is a probe, which costs the window no more
    than a reported loss does (RFC 8985 7); the second time, everything in flight is lost (RFC 9260 6.3.3).
    Newest-wins chunks are given up after a round trip and the peer's delay, with no effect on the others.
    """

    def __init__(self, settings: SctpSettings, round_trip: RoundTrip, initial_tsn: int, counts: Counter[str]) -> None:
        self._settings = settings
        self._round_trip = round_trip
        self._counts = counts
        self.queue = SendQueue(settings)
        self.window = CongestionWindow(settings)
        self.next_tsn = initial_tsn
        self.acknowledged = initial_tsn - 1  # everything up to this TSN has arrived
        self.ambiguous = False  # only repeated chunks were acknowledged, which says nothing about the round trip
        self._advanced = initial_tsn - 1  # the same, or given up (Advanced.Peer.Ack.Point, RFC 3758 3.5)
        self._outstanding: deque[Outgoing] = deque()  # by TSN, without a hole
        self._newest_waiting: deque[Outgoing] = deque()
        self._waiting: list[tuple[int, Outgoing]] = []  # the others, a heap by TSN; some may wait no longer
        self._newest_sent: deque[tuple[float, Outgoing]] = deque()
        self._sent: deque[tuple[float, Outgoing]] = deque()  # the others, as they left; some may be acknowledged
        self._flight = 0  # bytes
        self._newest_flight = 0
        self._peer_window = 0  # bytes that the peer still takes
        self._expiries = 0  # waits in vain since the last acknowledgement
        self._sacks = 0
        self._repeated: dict[int, None] = {}  # TSNs, the latest last
        self._sequences: dict[tuple[int, bool], int] = {}
        self._skips: dict[tuple[int, bool], int] = {}  # the last message given up, by stream and order
        self.forward_at: float | None = None  # the time at which a FORWARD TSN is due
        self._burst = 0  # bytes of reliable messages that may leave before the next acknowledgement or timer
        self._asked_at = float("-inf")  # the time at which a newest-wins chunk last had the I bit
        self._newest_floor = settings.newest_wins_floor * settings.max_packet
        self._floor = settings.window_floor * settings.max_packet
        self._may_give_up = False
        self._interleaving = False
        self._header = DATA_HEADER
        self._largest = settings.max_packet - COMMON_HEADER - DATA_HEADER  # payload of a chunk that fills a packet

    def peer_is(self, window: int, *, interleaving: bool, partial_reliability: bool) -> None:
        """Take the result of the handshake. Without partial reliability every message is reliable (RFC 3758 3.3.1)."""
        self._peer_window = window
        self._may_give_up = partial_reliability
        self._interleaving = interleaving
        self._header = INTERLEAVED_HEADER if interleaving else DATA_HEADER
        self._largest = self._settings.max_packet - COMMON_HEADER - self._header

    @property
    def idle(self) -> bool:
        """True if no chunk waits, and the peer has acknowledged all, also abandoned ones."""
        return not self._outstanding and self.forward_at is None and not len(self.queue)

    @property
    def outstanding(self) -> int:
        """The number of chunks with a TSN that are not acknowledged."""
        return len(self._outstanding)

    # Sending

    def _begin_burst(self) -> None:
        """Let reliable messages leave in a row (RFC 9260 6.1 D), because something has happened."""
        self._burst = self._settings.max_burst * self._settings.max_packet

    @property
    def is_quiet(self) -> bool:
        """True if nothing waits to leave, permitted or not."""
        return not (self.queue.newest or self._waiting or self.queue.turns or self._newest_waiting)

    def chunks(self, room: int, now: float) -> bytes:
        """Return the due chunks that fit into `room` bytes, newest-wins messages first."""
        taken = b""
        if not self._flight:
            self._begin_burst()
        header = self._header
        while (chunk := self._due(now)) is not None and chunk.size + header <= room:
            if chunk.newest_wins and chunk.sent_count == 0:
                self._newest_waiting.popleft()
            else:
                heappop(self._waiting)
            encoded = self._send(chunk, now)
            room -= len(encoded)
            taken = taken + encoded if taken else encoded
            if not (self.queue.newest or self._waiting or self.queue.turns or self._newest_waiting):
                break  # nothing else waits, as after most messages
        return taken

    def _due(self, now: float) -> Outgoing | None:
        """Return the next due chunk. RFC 9260 6.1 C would have repeats before everything new; newest-wins messages are
        before those too, which changes the order within some packets and nothing else, since each kind has its own
        window."""
        newest = self._newest_waiting
        while newest and newest[0].state is not _WAITING:
            newest.popleft()
        if not newest and self.queue.newest and self._admits_newest(self.queue.newest[0]):
            message = self.queue.take_newest()
            newest.extend(self._chunks(message, whole=True))
            message.taken = len(message.payload)
        if newest:
            return newest[0]
        waiting = self._waiting
        while waiting and waiting[0][1].state is not _WAITING:
            heappop(waiting)
        if not waiting:
            head = self.queue.head(now)
            if head is None or not self._admits(len(head.payload) - head.taken):
                return None
            chunks = self._chunks(head, whole=not self._interleaving)
            self.queue.took(head, sum(chunk.size for chunk in chunks))
            for chunk in chunks:
                heappush(waiting, (chunk.tsn, chunk))
        chunk = waiting[0][1]
        return chunk if self._admits(chunk.size) else None

    def _admits_newest(self, message: Message) -> bool:
        if self._newest_flight >= self._newest_floor and self._flight >= self.window.size:
            return False
        if self._flight and len(message.payload) > self._peer_window:
            return False
        return len(self._outstanding) < self._settings.max_outstanding

    def _admits(self, size: int) -> bool:
        """True if a chunk may leave that is not newest-wins (RFC 9260 6.1 A, B and D)."""
        if not self._flight:
            return True  # A: one chunk may always be in flight, also into a closed window
        if self._burst <= 0 or min(size, self._largest) > self._peer_window:
            return False
        return self._flight < self.window.size or self._flight - self._newest_flight < self._floor

    def _chunks(self, message: Message, *, whole: bool) -> list[Outgoing]:
        """Return the message's next chunk, or all of them. They have their TSNs from here on."""
        payload, largest, newest = message.payload, self._largest, message.newest_wins
        if message.ordered or self._interleaving:
            self._number(message)
        unordered = 0 if message.ordered else UNORDERED
        if len(payload) <= largest:
            chunk = Outgoing(self.next_tsn, WHOLE | unordered, message, 0, payload, newest)
            self.next_tsn += 1
            self._outstanding.append(chunk)
            return [chunk]
        chunks = []
        start = message.taken
        while start < len(payload):
            end = min(start + largest, len(payload))
            flags = (0 if start else BEGIN) | (END if end == len(payload) else 0) | unordered
            chunks.append(Outgoing(self.next_tsn, flags, message, start // largest, payload[start:end], newest))
            self.next_tsn += 1
            start = end
            if not whole:
                break
        message.chunks = [*(message.chunks or ()), *chunks]
        self._outstanding.extend(chunks)
        return chunks

    def _number(self, message: Message) -> None:
        """Give a message the next number on its stream, before its first fragment."""
        if not message.taken:
            key = message.stream, not message.ordered
            message.sequence = self._sequences.get(key, 0)
            self._sequences[key] = message.sequence + 1

    def _send(self, chunk: Outgoing, now: float) -> bytes:
        chunk.state = _IN_FLIGHT
        chunk.sent_at = now
        chunk.misses = 0
        chunk.sent_count += 1
        self._flight += chunk.size
        self._peer_window -= chunk.size
        if chunk.newest_wins:
            self._newest_flight += chunk.size
            self._newest_sent.append((now, chunk))
        else:
            self._burst -= chunk.size
            self._sent.append((now, chunk))
        if chunk.sent_count > 1:
            self._counts["repeats"] += 1
            self._repeated[chunk.tsn] = None
            if len(self._repeated) > REMEMBERED:
                del self._repeated[next(iter(self._repeated))]
        chunk.flags = chunk.flags & ~IMMEDIATE | self._immediate(chunk, now)
        return self._encode(chunk)

    def _immediate(self, chunk: Outgoing, now: float) -> int:
        """Return the I bit (RFC 7053): on the end of each reliable message, and where the window ends."""
        if not chunk.newest_wins:
            return IMMEDIATE if chunk.flags & END or not self._admits(self._largest) else 0
        if now - self._asked_at < self._settings.sample_interval:
            return 0
        if now - self._round_trip.sampled_at < self._settings.sample_interval:
            return 0
        self._asked_at = now
        return IMMEDIATE

    def _encode(self, chunk: Outgoing) -> bytes:
        message, tsn = chunk.message, chunk.tsn & MASK_32
        if self._interleaving:
            sequence = message.sequence & MASK_32
            either = message.protocol if chunk.flags & BEGIN else chunk.fragment
            return encode_interleaved(tsn, chunk.flags, message.stream, sequence, either, chunk.payload)
        return encode_data(
            tsn, chunk.flags, message.stream, message.sequence & MASK_16, message.protocol, chunk.payload
        )

    def forward_tsn(self, now: float) -> ForwardTsn | InterleavedForwardTsn | None:
        """Return the chunk that tells the peer of messages that were given up, when it is due (RFC 3758 3.5)."""
        if self.forward_at is None or now < self.forward_at:
            return None
        self.forward_at = now + self._round_trip.timeout(1)
        skips = [Skip(stream, last, unordered) for (stream, unordered), last in self._skips.items()]
        cumulative = self._advanced & MASK_32
        if self._interleaving:
            return InterleavedForwardTsn(
                cumulative, [Skip(skip.stream, skip.sequence & MASK_32, skip.unordered) for skip in skips]
            )
        return ForwardTsn(cumulative, [Skip(skip.stream, skip.sequence & MASK_16) for skip in skips])

    def reset(self, streams: tuple[int, ...]) -> None:
        """Number the messages of these streams from 0 again: the peer has reset them (RFC 6525 5.2.7)."""
        for stream in streams:
            for unordered in (False, True):
                self._sequences.pop((stream, unordered), None)
                self._skips.pop((stream, unordered), None)

    # Acknowledgements

    def receive_sack(self, sack: Sack, now: float) -> None:
        """Take a SACK (RFC 9260 6.2.1)."""
        cumulative = unwrap(sack.cumulative, self.acknowledged)
        if cumulative < self.acknowledged:
            return  # D i: overtaken by a later one
        if cumulative >= self.next_tsn:
            self._counts["sack_of_unsent"] += 1
            return
        self._sacks += 1
        self._begin_burst()
        was_full = self._flight >= self.window.size
        arrived: list[Outgoing] = []  # with this SACK
        outstanding = self._outstanding
        while outstanding and outstanding[0].tsn <= cumulative:
            chunk = outstanding.popleft()
            if chunk.state is _IN_FLIGHT:
                arrived.append(chunk)
                self._land(chunk)
            chunk.state = _ACKNOWLEDGED
        self.acknowledged = cumulative
        if sack.gaps and outstanding:
            self._take_gaps(sack, arrived)
        if arrived:
            self._expiries = 0
            self._measure(arrived, now)
            size = arrived[0].size if len(arrived) == 1 else sum(chunk.size for chunk in arrived)
            self.window.acknowledged(size, was_full, cumulative)
        if sack.duplicates:
            self._take_duplicates(sack, now)
        if sack.gaps and arrived and outstanding:
            self._count_misses(arrived, now)
        self._peer_window = sack.window - self._flight
        self._advance(now)

    def _land(self, chunk: Outgoing) -> None:
        """Note that a chunk is not in flight any more."""
        self._flight -= chunk.size
        self._peer_window += chunk.size  # 6.2.1 C
        if chunk.newest_wins:
            self._newest_flight -= chunk.size

    def _take_gaps(self, sack: Sack, arrived: list[Outgoing]) -> None:
        first = self._outstanding[0].tsn
        done = self.acknowledged  # everything up to here was looked at, so that overlapping gaps cost nothing
        for start, end in sack.gaps:
            begin = max(self.acknowledged + start, done + 1, first)
            done = max(done, min(self.acknowledged + end, self.next_tsn - 1))
            for tsn in range(begin, done + 1):
                chunk = self._outstanding[tsn - first]
                chunk.reported = self._sacks
                if chunk.state is _IN_FLIGHT:
                    arrived.append(chunk)
                    self._land(chunk)
                if chunk.sent_count and chunk.state is not _ABANDONED:
                    chunk.state = _ACKNOWLEDGED

    def _measure(self, arrived: list[Outgoing], now: float) -> None:
        """Measure one round trip, by the latest chunk that was sent once and that the peer acknowledges at once."""
        latest = float("-inf")
        ambiguous = False
        for chunk in arrived:
            if chunk.flags & IMMEDIATE:
                if chunk.sent_count > 1:
                    ambiguous = True
                elif chunk.sent_at > latest:
                    latest = chunk.sent_at
        if latest != float("-inf"):
            self._round_trip.sample(now - latest, now)
        elif ambiguous:
            self.ambiguous = True

    def _take_duplicates(self, sack: Sack, now: float) -> None:
        for duplicate in sack.duplicates:
            tsn = unwrap(duplicate, self.acknowledged)
            if tsn in self._repeated:
                del self._repeated[tsn]
                self._counts["needless_repeats"] += 1
                self._round_trip.needless(now)

    def _count_misses(self, arrived: list[Outgoing], now: float) -> None:
        """Count chunks that left before one that has arrived now (RFC 9260 7.2.4). A repeated chunk may be missed
        again, by chunks that left after the repeat. Three misses within the path's jitter are not a loss yet (as in RFC
        8985 6.2)."""
        once = [chunk for chunk in arrived if chunk.sent_count == 1]
        if not once:
            return
        highest, latest = max(chunk.tsn for chunk in once), max(chunk.sent_at for chunk in once)
        lost = []
        for chunk in self._outstanding:
            if chunk.tsn >= highest:
                break
            if chunk.state is _IN_FLIGHT and chunk.sent_at <= latest:
                chunk.misses += 1
                if chunk.misses >= MISSES and now - chunk.sent_at >= self._round_trip.reordering:
                    lost.append(chunk)
        for chunk in lost:
            self._lose(chunk, now)
        if lost:
            self.window.lost(self.next_tsn - 1)

    # Losses

    def _lose(self, chunk: Outgoing, now: float) -> None:
        if chunk.state is not _IN_FLIGHT:
            return
        message = chunk.message
        if self._may_give_up and (
            (message.max_retransmits is not None and chunk.sent_count > message.max_retransmits)
            or (message.expires is not None and now >= message.expires)
        ):
            self._abandon(chunk)
            return
        self._land(chunk)
        chunk.state = _WAITING
        heappush(self._waiting, (chunk.tsn, chunk))

    def _abandon(self, chunk: Outgoing) -> None:
        """Give up the whole message, also its unsent part (RFC 3758 3.5 A3)."""
        message = chunk.message
        message.abandoned = True
        self._counts["abandoned"] += 1
        for each in message.chunks or (chunk,):
            if each.state is _IN_FLIGHT:
                self._land(each)
            if each.state is not _ACKNOWLEDGED:
                each.state = _ABANDONED
                each.payload = b""
        if message.chunks and message.taken < len(message.payload):
            self._forgo_rest(message, chunk.flags & UNORDERED)

    def _forgo_rest(self, message: Message, unordered: int) -> None:
        """Put a TSN in the place of the fragments that have none yet. The peer may have all others by now, and would
        take a FORWARD TSN that ends with them for an old one."""
        rest = Outgoing(self.next_tsn, END | unordered, message, 0, b"", message.newest_wins)
        rest.state = _ABANDONED
        self.next_tsn += 1
        self._outstanding.append(rest)

    def _advance(self, now: float) -> None:
        """Move the point up to which everything has arrived or was given up (RFC 3758 3.5 C2).

        It passes single messages that the peer has, so that one FORWARD TSN tells of all holes. It stops at fragments
        of a message that is not given up: a peer would drop those.
        """
        if self._advanced <= self.acknowledged:
            self._advanced = self.acknowledged
        outstanding, skips = self._outstanding, self._skips
        moved = False
        while outstanding:
            chunk = outstanding[0]
            if chunk.state is _ABANDONED:
                key = chunk.message.stream, bool(chunk.flags & UNORDERED)
                if self._interleaving or not key[1]:
                    if key not in skips and len(skips) >= self._most_skips:
                        break
                    skips[key] = max(chunk.message.sequence, skips.get(key, 0))
                moved = True
            elif self._advanced == self.acknowledged or not _is_done_with(chunk):
                break
            outstanding.popleft()
            self._advanced = chunk.tsn
        if self.acknowledged >= self._advanced:
            skips.clear()
            self.forward_at = None
        elif moved:
            self.forward_at = now

    @property
    def _most_skips(self) -> int:
        """The number of streams that fit into one FORWARD TSN."""
        return (self._settings.max_packet - COMMON_HEADER - 8) // (8 if self._interleaving else 4)

    # Time

    def deadline(self) -> float | None:
        """Return the time at which `handle_timer` is due; a FORWARD TSN that is due at once counts as past."""
        due = self.forward_at
        if (sent := _first(self._sent)) is not None:
            expires = sent + self._round_trip.timeout(self._expiries)
            due = expires if due is None else min(due, expires)
        if (sent := _first(self._newest_sent)) is not None:
            expires = sent + self._newest_timeout
            due = expires if due is None else min(due, expires)
        return due

    @property
    def _newest_timeout(self) -> float:
        return self._round_trip.timeout(0) + self._settings.peer_acknowledgement_delay

    def handle_timer(self, now: float) -> None:
        self._begin_burst()
        newest_timeout = self._newest_timeout
        while (sent := _first(self._newest_sent)) is not None and sent + newest_timeout <= now:
            self._lose(self._newest_sent.popleft()[1], now)
        timeout = self._round_trip.timeout(self._expiries)
        if (sent := _first(self._sent)) is not None and sent + timeout <= now:
            self._expire(timeout, now)
        self._advance(now)

    def _expire(self, timeout: float, now: float) -> None:
        self._expiries += 1
        self._counts["timeouts"] += 1
        if self._expiries == 1:
            while (sent := _first(self._sent)) is not None and sent + timeout <= now:
                self._lose(self._sent.popleft()[1], now)
            self.window.lost(self.next_tsn - 1)
            return
        for chunk in list(self._outstanding):
            if not chunk.newest_wins:
                self._lose(chunk, now)
            if chunk.state is _ACKNOWLEDGED and chunk.reported != self._sacks:
                chunk.state = _WAITING  # the peer has dropped acknowledged chunks (RFC 9260 6.2.1 D iii)
                heappush(self._waiting, (chunk.tsn, chunk))
        self.window.expired()

    def clear(self) -> None:
        """Drop everything: the association has ended."""
        self.queue.clear()
        for each in (self._outstanding, self._newest_waiting, self._sent, self._newest_sent):
            each.clear()
        self._waiting.clear()
        self._skips.clear()
        self.forward_at = None


def _is_done_with(chunk: Outgoing) -> bool:
    """True if the peer has the chunk, and keeps no fragment of a message because of it."""
    is_whole = chunk.flags & WHOLE == WHOLE
    return chunk.state is _ACKNOWLEDGED and (is_whole or chunk.message.abandoned)


def _first(sent: deque[tuple[float, Outgoing]]) -> float | None:
    """Return the time at which the first of these left that is still in flight."""
    while sent:
        left, chunk = sent[0]
        if chunk.state is _IN_FLIGHT and chunk.sent_at == left:
            return left
        sent.popleft()
    return None
