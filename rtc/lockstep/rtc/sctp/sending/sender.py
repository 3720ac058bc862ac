"""Turns messages into chunks, and keeps these until acknowledged or given up (RFC 9260 6.1 to 6.3, RFC 3758 3.5)."""

from collections import Counter, deque
from heapq import heappop, heappush

from lockstep.rtc.sctp.sending.fragmentation import Fragmentation
from lockstep.rtc.sctp.sending.outgoing import IN_FLIGHT, WAITING, Outgoing
from lockstep.rtc.sctp.sending.outstanding import Outstanding
from lockstep.rtc.sctp.sending.partial_reliability import PartialReliability
from lockstep.rtc.sctp.sending.retransmission_timer import RetransmissionTimer
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.sending.round_trip_samples import RoundTripSamples
from lockstep.rtc.sctp.sending.send_queue import SendQueue
from lockstep.rtc.sctp.sending.send_window import SendWindow
from lockstep.rtc.sctp.serial import unwrap
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import END, IMMEDIATE, Sack

__all__ = ["Sender"]


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
        self._round_trip = round_trip
        self._counts = counts
        self._most_outstanding = settings.max_outstanding
        self.queue = SendQueue(settings)
        self.window = SendWindow(settings)
        self.samples = RoundTripSamples(round_trip, settings.sample_interval, counts)
        self.timer = RetransmissionTimer(round_trip, settings.peer_acknowledgement_delay)
        self.fragmentation = Fragmentation(settings, initial_tsn)
        self.outstanding = Outstanding(initial_tsn, self.window)
        self.partial = PartialReliability(
            self.fragmentation, self.outstanding, self.window, round_trip, settings.max_packet, counts
        )
        self._newest_waiting: deque[Outgoing] = deque()
        self._waiting: list[tuple[int, Outgoing]] = []  # the others, a heap by TSN; some may wait no longer

    def peer_is(self, window: int, *, interleaving: bool, partial_reliability: bool) -> None:
        """Take the result of the handshake."""
        self.window.peer_window = window
        self.partial.agreed = partial_reliability
        self.fragmentation.peer_is(interleaving=interleaving)

    @property
    def idle(self) -> bool:
        """True if no chunk waits, and the peer has acknowledged all, also abandoned ones."""
        return not self.outstanding.chunks and self.partial.forward_at is None and not len(self.queue)

    @property
    def is_quiet(self) -> bool:
        """True if nothing waits to leave, permitted or not."""
        return not (self.queue.newest or self._waiting or self.queue.turns or self._newest_waiting)

    def chunks(self, room: int, now: float) -> bytes:
        """Return the due chunks that fit into `room` bytes, newest-wins messages first."""
        taken = b""
        if not self.window.flight:
            self.window.begin_burst()
        header = self.fragmentation.header
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
        newest, queue, window, fragmentation = self._newest_waiting, self.queue, self.window, self.fragmentation
        while newest and newest[0].state is not WAITING:
            newest.popleft()
        if (
            not newest
            and queue.newest
            and len(self.outstanding.chunks) < self._most_outstanding
            and window.admits_newest(len(queue.newest[0].payload))
        ):
            message = queue.take_newest()
            newest.extend(fragmentation.chunks(message, whole=True))
            self.outstanding.chunks.extend(newest)
            message.taken = len(message.payload)
        if newest:
            return newest[0]
        waiting = self._waiting
        while waiting and waiting[0][1].state is not WAITING:
            heappop(waiting)
        if not waiting:
            head = queue.head(now)
            if head is None or not window.admits(min(len(head.payload) - head.taken, fragmentation.largest)):
                return None
            chunks = fragmentation.chunks(head, whole=not fragmentation.interleaving)
            self.outstanding.chunks.extend(chunks)
            queue.took(head, sum(chunk.size for chunk in chunks))
            for chunk in chunks:
                heappush(waiting, (chunk.tsn, chunk))
        chunk = waiting[0][1]
        return chunk if window.admits(chunk.size) else None

    def _send(self, chunk: Outgoing, now: float) -> bytes:
        chunk.state = IN_FLIGHT
        chunk.sent_at = now
        chunk.misses = 0
        chunk.sent_count += 1
        self.window.left(chunk)
        self.timer.left(chunk, now)
        if chunk.sent_count > 1:
            self.samples.repeated(chunk)
        # The I bit (RFC 7053): on the end of each reliable message, and where the window ends
        if chunk.newest_wins:
            immediate = self.samples.wants_one(now)
        else:
            immediate = bool(chunk.flags & END) or not self.window.admits(self.fragmentation.largest)
        chunk.flags = chunk.flags | IMMEDIATE if immediate else chunk.flags & ~IMMEDIATE
        return self.fragmentation.encode(chunk)

    def receive_sack(self, sack: Sack, now: float) -> None:
        """Take a SACK (RFC 9260 6.2.1)."""
        outstanding, window = self.outstanding, self.window
        cumulative = unwrap(sack.cumulative, outstanding.acknowledged)
        if cumulative < outstanding.acknowledged:
            return  # D i: overtaken by a later one
        if cumulative >= self.fragmentation.next_tsn:
            self._counts["sack_of_unsent"] += 1
            return
        window.begin_burst()
        was_full = window.flight >= window.congestion.size
        arrived = outstanding.take(sack, cumulative)
        if arrived:
            self.timer.expiries = 0
            self.samples.take(arrived, now)
            size = arrived[0].size if len(arrived) == 1 else sum(chunk.size for chunk in arrived)
            window.congestion.acknowledged(size, was_full, cumulative)
        if sack.duplicates:
            self.samples.take_duplicates(sack.duplicates, cumulative, now)
        if sack.gaps and arrived and outstanding.chunks:
            lost = outstanding.missed(arrived, now, self._round_trip.reordering)
            for chunk in lost:
                self._lose(chunk, now)
            if lost:
                window.congestion.lost(self.fragmentation.next_tsn - 1)
        window.peer_window = sack.window - window.flight
        self.partial.advance(now)

    def _lose(self, chunk: Outgoing, now: float) -> None:
        if chunk.state is IN_FLIGHT and not self.partial.gives_up(chunk, now):
            self.window.landed(chunk)
            self._wait(chunk)

    def _wait(self, chunk: Outgoing) -> None:
        chunk.state = WAITING
        heappush(self._waiting, (chunk.tsn, chunk))

    def handle_timer(self, now: float) -> None:
        self.window.begin_burst()
        for chunk in self.timer.late_newest(now):
            self._lose(chunk, now)
        if self.timer.expires(now):
            self._expire(now)
        self.partial.advance(now)

    def _expire(self, now: float) -> None:
        self._counts["timeouts"] += 1
        if self.timer.expiries == 1:
            for chunk in self.timer.late(now):
                self._lose(chunk, now)
            self.window.congestion.lost(self.fragmentation.next_tsn - 1)
            return
        for chunk in list(self.outstanding.chunks):
            if not chunk.newest_wins:
                self._lose(chunk, now)
            if self.outstanding.was_dropped(chunk):
                self._wait(chunk)
        self.window.congestion.expired()

    def reset(self, streams: tuple[int, ...]) -> None:
        """Begin anew with these streams: the peer has reset them (RFC 6525 5.2.7)."""
        self.fragmentation.reset(streams)
        self.partial.reset(streams)

    def clear(self) -> None:
        """Drop everything: the association has ended."""
        self.queue.clear()
        self.outstanding.chunks.clear()
        self._newest_waiting.clear()
        self._waiting.clear()
        self.timer.clear()
        self.partial.clear()
