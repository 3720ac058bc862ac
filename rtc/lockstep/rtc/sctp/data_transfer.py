"""What flows between the handshake and the end: messages, their acknowledgements, stream resets (RFC 9260 6)."""

from collections import Counter

from lockstep.rtc.sctp.events import Established, Event, OutgoingStreamsReset, StreamsReset
from lockstep.rtc.sctp.heartbeat import Heartbeats
from lockstep.rtc.sctp.lifecycle import Lifecycle
from lockstep.rtc.sctp.packets import Packets
from lockstep.rtc.sctp.peer_init import PeerInit
from lockstep.rtc.sctp.receiving.receiver import PLAIN_SACK, Receiver
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.sending.sender import Sender
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.stream_reset import StreamReset
from lockstep.rtc.sctp.wire.chunks import (
    Data,
    Error,
    ForwardTsn,
    InterleavedData,
    InterleavedForwardTsn,
    Reconfig,
    Sack,
)
from lockstep.rtc.sctp.wire.packet import COMMON_HEADER
from lockstep.rtc.sctp.wire.parameters import INVALID_STREAM

__all__ = ["DataTransfer"]

ROOM_BESIDE_SACK = 192  # bytes


class DataTransfer:
    """Joins the sender, the receiver and the stream resets: they share packets. `events` is drained by its owner."""

    def __init__(
        self,
        settings: SctpSettings,
        initial_tsn: int,
        lifecycle: Lifecycle,
        packets: Packets,
        round_trip: RoundTrip,
        counts: Counter[str],
    ) -> None:
        self.peer: PeerInit | None = None  # None until the handshake has shown it
        self.heartbeats = Heartbeats(lifecycle, packets, round_trip)
        self.sender = Sender(settings, round_trip, initial_tsn, counts)
        self.receiver = Receiver(settings, 0, False, counts)
        self.resets = StreamReset(initial_tsn, 0)
        self.events: list[Event] = []
        self._settings = settings
        self._initial_tsn = initial_tsn
        self._lifecycle = lifecycle
        self._packets = packets
        self._round_trip = round_trip
        self._counts = counts
        self._room = settings.max_packet - COMMON_HEADER
        self._late_sack: tuple[Sack, float] | None = None  # received, and when; not looked at yet

    # The beginning and the end

    def peer_is(self, peer: PeerInit) -> None:
        """Take what the peer has said of itself."""
        settings = self._settings
        self.peer = peer
        interleaving = settings.interleaving and peer.interleaving
        self.receiver = Receiver(settings, peer.initial_tsn, interleaving, self._counts)
        self.resets = StreamReset(self._initial_tsn, peer.initial_tsn)
        self.sender.peer_is(peer.window, interleaving=interleaving, partial_reliability=peer.partial_reliability)

    def begin(self) -> None:
        """Note that the peer knows of this end too."""
        assert self.peer is not None
        if self._round_trip.smoothed is None:
            self.sender.samples.ambiguous = True
        self.events.append(
            Established(self.peer.inbound_streams, self._settings.interleaving and self.peer.interleaving)
        )

    def end(self) -> None:
        """Hand out what has come, and drop what waits."""
        assert self._lifecycle.closed is not None
        self.events += self.receiver.messages
        self.receiver = Receiver(self._settings, 0, False, self._counts)
        self._packets.control.clear()
        self.sender.clear()
        self._late_sack = None
        self.events.append(self._lifecycle.closed)

    # Chunks in

    def receive_data(self, chunk: Data | InterleavedData, now: float) -> None:
        if not self._lifecycle.may_receive:
            self._counts["unexpected"] += 1
        elif not self.receiver.receive_data(chunk, now):
            self._packets.answer(Error([(INVALID_STREAM, chunk.stream.to_bytes(2, "big") + bytes(2))]))

    def receive_forward_tsn(self, chunk: ForwardTsn | InterleavedForwardTsn, now: float) -> None:
        if self._lifecycle.may_receive:
            self.receiver.receive_forward_tsn(chunk, now)
        else:
            self._counts["unexpected"] += 1

    def packet_ends(self, now: float) -> None:
        """Note that all chunks of a packet were received."""
        receiver = self.receiver
        if receiver.packet_ends(now):
            if messages := receiver.messages:
                self.events += messages
                messages.clear()
            if events := self.resets.advanced(receiver.received.cumulative):
                self._take_reset_events(events)

    def receive_sack(self, chunk: Sack, now: float) -> None:
        """Keep it until something is to be sent or timed: a message in the same packet may be a command, and goes on
        before it."""
        if self._lifecycle.is_up:
            self.take_late_sack()
            self._late_sack = chunk, now

    def take_late_sack(self) -> None:
        """Hand the SACK that was kept to the sender."""
        if self._late_sack is not None:
            (chunk, now), self._late_sack = self._late_sack, None
            self.sender.receive_sack(chunk, now)

    def receive_reconfig(self, chunk: Reconfig, now: float) -> None:
        if self._lifecycle.is_up:
            self._take_reset_events(self.resets.receive(chunk, self.receiver.received.cumulative, now))

    def _take_reset_events(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, StreamsReset):
                self.receiver.reassembly.reset(event.streams)
            elif isinstance(event, OutgoingStreamsReset) and event.done:
                self.sender.reset(event.streams)
        self.events += events

    # Chunks out

    def bundle(self, now: float) -> None:
        """Fill packets with everything that may leave now; mostly there is nothing."""
        sender, receiver = self.sender, self.receiver
        while (
            not sender.is_quiet
            or (receiver.acknowledge_at is not None and receiver.acknowledge_at <= now)
            or self._has_due_control(now)
        ) and (chunks := self._next_chunks(now)):
            self._packets.send(chunks)

    def _has_due_control(self, now: float) -> bool:
        sender, resets = self.sender, self.resets
        forward_at = sender.partial.forward_at
        return bool(
            self._packets.control
            or sender.samples.ambiguous
            or resets.answers
            or (forward_at is not None and forward_at <= now)
            or (resets.due_at is not None and resets.due_at <= now)
        )

    def _next_chunks(self, now: float) -> bytes:
        """Return the next packet's chunks: control first (RFC 9260 6.10); a pending SACK travels with data (6.2)."""
        sender, receiver = self.sender, self.receiver
        control = self.take_control(self._room, now) if self._has_due_control(now) else b""
        room = self._room - len(control)
        if not receiver.is_pending:
            return control + sender.chunks(room, now)
        if receiver.acknowledge_at is not None and receiver.acknowledge_at <= now:
            if len(control) > ROOM_BESIDE_SACK:
                return control
            chunks = control + receiver.take_sack()
            return chunks if sender.is_quiet else chunks + sender.chunks(self._room - len(chunks), now)
        data = sender.chunks(room - PLAIN_SACK, now)
        if data:
            return control + receiver.take_sack() + data
        return control + sender.chunks(room, now)

    def take_control(self, room: int, now: float) -> bytes:
        """Take the control chunks that are due and fit."""
        control, sender, resets = self._packets.control, self.sender, self.resets
        forward = sender.partial.forward_tsn(now)
        if forward is not None:
            control.append(forward.encode())
        request = resets.next_request(sender.fragmentation.next_tsn - 1, now)
        if request is not None:
            resets.sent(now + self._round_trip.timeout(resets.tries))
            control.append(request.encode())
        if resets.answers:
            control += [Reconfig([answer]).encode() for answer in resets.answers]
            resets.answers.clear()
        if sender.samples.ambiguous:
            sender.samples.ambiguous = False
            self.heartbeats.ask(now)
        return self._packets.take_control(room)
