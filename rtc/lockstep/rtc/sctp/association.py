"""One SCTP association over DTLS (RFC 9260, RFC 8261), without I/O."""

from collections import Counter
from collections.abc import Callable
from enum import Enum
from struct import Struct
from typing import Any

from lockstep.rtc.sctp.errors import AssociationClosed, MessageTooLarge, ProtocolViolation, SctpParseError
from lockstep.rtc.sctp.events import Closed, Established, Event, OutgoingStreamsReset, StreamsReset
from lockstep.rtc.sctp.handshake import Cookies, PeerInit, own_parameters, read_init, unrecognized
from lockstep.rtc.sctp.heartbeat import Heartbeats
from lockstep.rtc.sctp.receiver import PLAIN_SACK, Receiver
from lockstep.rtc.sctp.round_trip import RoundTrip
from lockstep.rtc.sctp.send_queue import Message
from lockstep.rtc.sctp.sender import Sender
from lockstep.rtc.sctp.serial import MASK_32
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.stream_reset import StreamReset
from lockstep.rtc.sctp.wire.chunks import (
    Abort,
    Chunk,
    CookieAck,
    CookieEcho,
    Data,
    Error,
    ForwardTsn,
    Heartbeat,
    HeartbeatAck,
    Init,
    InitAck,
    InterleavedData,
    InterleavedForwardTsn,
    Reconfig,
    Sack,
    Shutdown,
    ShutdownAck,
    ShutdownComplete,
    Unknown,
)
from lockstep.rtc.sctp.wire.packet import COMMON_HEADER, Packet, decode_packet, encode_packet
from lockstep.rtc.sctp.wire.parameters import (
    INVALID_STREAM,
    PROTOCOL_VIOLATION,
    STALE_COOKIE,
    STATE_COOKIE,
    UNRECOGNIZED_CHUNK,
    USER_ABORT,
)

__all__ = ["Association", "State"]

MOST_STREAMS = 65535  # announced; RFC 8831 6.2
ROOM_BESIDE_SACK = 192  # bytes
MOST_CONTROL = 64  # chunks that wait to leave; the peer gets no answers beyond them
MOST_REPORTED = 128  # bytes of an unknown chunk in the report to its sender

_word = Struct("!L")


class State(Enum):
    """The states of RFC 9260 4."""

    CLOSED = "closed"
    COOKIE_WAIT = "cookie-wait"
    COOKIE_ECHOED = "cookie-echoed"
    ESTABLISHED = "established"
    SHUTDOWN_PENDING = "shutdown-pending"
    SHUTDOWN_SENT = "shutdown-sent"
    SHUTDOWN_RECEIVED = "shutdown-received"
    SHUTDOWN_ACK_SENT = "shutdown-ack-sent"


_CAN_SEND = frozenset({State.ESTABLISHED, State.SHUTDOWN_PENDING, State.SHUTDOWN_RECEIVED})
_CAN_RECEIVE = frozenset({State.COOKIE_ECHOED, State.ESTABLISHED, State.SHUTDOWN_PENDING, State.SHUTDOWN_SENT})
_UP = _CAN_SEND | {State.SHUTDOWN_SENT}
_WANTS_TO_SEND = frozenset({State.CLOSED, State.COOKIE_WAIT, State.COOKIE_ECHOED, State.ESTABLISHED})


class Association:
    """One SCTP association: messages over the packets that DTLS carries.

    Give every packet to `receive_packet`, call `handle_timer` when `timer` is due, and after each call of any method
    send the packets of `packets_to_send` and read `events`. `now` is seconds of one monotonic clock. Both ends call
    `start` when DTLS is up, as RFC 8841 9.3 wants; one end alone suffices.

    Nothing but the owner, the peer or a protocol error ends an association, and `Closed` names which. In particular
    there is no Association.Max.Retrans (RFC 9260 8.1) and no Max.Init.Retransmits: below lies ICE, whose consent
    (RFC 7675) already says whether the peer is there and wants packets, on the same path, by a clock instead of a
    count. A count of repeats is the worse judge: with short intervals, an outage of seconds or a path of 600 ms with
    some loss reaches any count that was meant for minutes. So repeats go on, at an interval that stays short, until
    the owner, who knows of consent, calls `abort`.

    A restart by the peer (RFC 9260 5.2.4 A) ends the association: WebRTC has none, since it comes with a new DTLS
    connection.

    `counts` has dropped input and other incidents, by name.
    """

    def __init__(
        self,
        settings: SctpSettings,
        random_bytes: Callable[[int], bytes],
        *,
        peer_port: int | None = None,
        peer_max_message: int | None = None,
    ) -> None:
        """`random_bytes` is `os.urandom` or a seeded substitute. `peer_max_message` is the peer's a=max-message-size
        (0: any), RFC 8841 6."""
        self.settings = settings
        self.counts: Counter[str] = Counter()
        self.state = State.CLOSED
        self._is_up = False
        self._may_receive = False
        self._late_sack: tuple[Sack, float] | None = None  # received, and when; not looked at yet
        self.round_trip = RoundTrip(settings)
        self.max_message = min(settings.max_send_message, peer_max_message or settings.max_send_message)
        self._ended = False
        self.now = 0.0  # the last time that was handed in
        self._peer_port = settings.port if peer_port is None else peer_port
        self._tag = int.from_bytes(random_bytes(4), "big") or 1
        self._cookies = Cookies(random_bytes(32), settings.cookie_lifetime)
        self._initial_tsn = int.from_bytes(random_bytes(4), "big")
        self._sender = Sender(settings, self.round_trip, self._initial_tsn, self.counts)
        self._peer: PeerInit | None = None
        self._receiver = Receiver(settings, 0, False, self.counts)
        self._resets = StreamReset(self._initial_tsn, 0)
        self._room = settings.max_packet - COMMON_HEADER
        self._packets: list[bytes] = []  # ready to leave
        self._control: list[bytes] = []  # chunks that leave with the next packet
        self._events: list[Event] = []
        self._cookie = b""  # from the peer
        self._cookie_is_due = False
        self._repeat_at: float | None = None  # T1 or T2
        self._repeats = 0
        self._asked_at = 0.0  # the time at which the handshake's chunk left
        self._heartbeats = Heartbeats()
        self._handlers: dict[type, Callable[[Any], None]] = {
            Data: self._receive_data,
            InterleavedData: self._receive_data,
            Sack: self._receive_sack,
            Init: self._receive_init,
            InitAck: self._receive_init_ack,
            CookieEcho: self._receive_cookie_echo,
            CookieAck: self._receive_cookie_ack,
            Heartbeat: self._receive_heartbeat,
            HeartbeatAck: self._receive_heartbeat_ack,
            ForwardTsn: self._receive_forward_tsn,
            InterleavedForwardTsn: self._receive_forward_tsn,
            Reconfig: self._receive_reconfig,
            Abort: self._receive_abort,
            Error: self._receive_error,
            Shutdown: self._receive_shutdown,
            ShutdownAck: self._receive_shutdown_ack,
            ShutdownComplete: self._receive_shutdown_complete,
        }

    # Methods for the owner

    def start(self, now: float) -> None:
        """Begin the handshake, when the peer has not done so already."""
        self.now = now
        if self.state is State.CLOSED and not self._ended:
            self._become(State.COOKIE_WAIT)
            self._send_init()

    def send(
        self,
        stream: int,
        protocol: int,
        payload: bytes,
        now: float,
        *,
        ordered: bool = True,
        max_retransmits: int | None = None,
        lifetime: float | None = None,
    ) -> None:
        """Send a message. Before the handshake is done, it waits.

        It is given up after `max_retransmits` repeats, or `lifetime` seconds from now (RFC 3758, RFC 7496). Unordered
        with `max_retransmits=0` it is newest-wins: it waits for nothing else, and old ones make room for newer ones.

        Raises:
            AssociationClosed: it has ended or is shutting down.
            MessageTooLarge: more than `max_message` bytes.
            SendQueueFull: too much waits on this stream.
            ValueError: an empty message, which SCTP does not have (RFC 8831 6.6 has protocols for it).
        """
        self.now = now
        if self._ended or (self.state is not State.ESTABLISHED and self.state not in _WANTS_TO_SEND):
            raise AssociationClosed("the association has ended")
        if not payload:
            raise ValueError("an SCTP message has at least one byte")
        if len(payload) > self.max_message:
            raise MessageTooLarge(f"{len(payload)} of at most {self.max_message} bytes")
        expires = None if lifetime is None else now + lifetime
        self._sender.queue.put(Message(stream, protocol, payload, ordered, max_retransmits, expires))

    def buffered(self, stream: int) -> int:
        """Return the number of bytes that wait on this stream, without newest-wins messages."""
        return self._sender.queue.buffered(stream)

    def has_waiting(self, stream: int) -> bool:
        """True if a message waits on this stream that has not begun to leave."""
        return self._sender.queue.has(stream)

    def reset_streams(self, streams: tuple[int, ...], now: float) -> bool:
        """Reset these outgoing streams, on which nothing waits. Return False if the peer cannot (RFC 6525 5.1.1)."""
        self.now = now
        if self._ended or self._peer is None or not self._peer.reconfiguration:
            return False
        self._resets.ask(streams, now)
        return True

    def shutdown(self, now: float) -> None:
        """End when everything has arrived (RFC 9260 9.2). Messages that arrive meanwhile are still received."""
        self.now = now
        if self.state is State.ESTABLISHED:
            self._become(State.SHUTDOWN_PENDING)
            self._go_on_shutting_down()
        elif self.state in (State.CLOSED, State.COOKIE_WAIT, State.COOKIE_ECHOED) and not self._ended:
            self._end("closed")

    def abort(self, now: float, reason: str = "aborted") -> None:
        """End at once, and tell the peer (RFC 9260 9.1). `reason` comes back in `Closed`."""
        self.now = now
        if self._ended:
            return
        if self._peer is not None:
            self._send_alone(self._peer.tag, Abort([(USER_ABORT, b"")]))
        self._end(reason)

    # The interface of every core

    def receive_packet(self, data: bytes, now: float) -> None:
        """Take a packet from DTLS. Nothing is raised: bad input is dropped and counted, or ends the association."""
        self.now = now
        try:
            packet = decode_packet(data)
        except SctpParseError:
            self.counts["malformed"] += 1
            return
        refused = self._refusal(packet)
        if refused:
            self.counts[refused] += 1
            return
        try:
            for chunk in packet.chunks:
                handler = self._handlers.get(type(chunk))
                if handler is not None:
                    handler(chunk)
                elif not self._report_unknown(chunk):
                    break
                if self._ended:
                    return
        except ProtocolViolation as violation:
            self._violated(violation.reason)
            return
        self._after_packet()

    def packets_to_send(self) -> list[bytes]:
        """Return every due packet, as of the last `now`. SACK and data share packets."""
        if not self._ended:
            self._take_late_sack()
            if self._is_up:
                self._bundle()
            elif self._cookie_is_due:
                self._send_cookie()
            elif self.state is State.SHUTDOWN_ACK_SENT and self._control:
                self._packets.append(self._packet(self._take_control(self.settings.max_packet)))
        packets, self._packets = self._packets, []
        return packets

    def timer(self) -> float | None:
        """Return the time at which `handle_timer` is due; None: never."""
        if self._ended:
            return None
        self._take_late_sack()
        due = self._repeat_at
        if self._is_up:
            for each in (self._receiver.acknowledge_at, self._resets.due_at, self._sender.deadline()):
                if each is not None and (due is None or each < due):
                    due = each
        return due

    def handle_timer(self, now: float) -> None:
        """Repeat unacknowledged chunks. They leave with `packets_to_send`."""
        self.now = now
        if self._ended:
            return
        self._take_late_sack()
        if self._repeat_at is not None and now >= self._repeat_at:
            self._repeats += 1
            self._repeat()
        if self._is_up:
            self._sender.handle_timer(now)

    def events(self) -> list[Event]:
        """Return the events since the last call."""
        events, self._events = self._events, []
        return events

    def _become(self, state: State) -> None:
        self.state = state
        self._is_up = state in _UP
        self._may_receive = state in _CAN_RECEIVE

    # Packets out

    def _bundle(self) -> None:
        if self.state is not State.ESTABLISHED:
            self._go_on_shutting_down()
        while self._has_due() and (chunks := self._next_chunks()):
            self._packets.append(self._packet(chunks))

    def _has_due(self) -> bool:
        """True if anything may leave now; mostly there is nothing."""
        acknowledge_at = self._receiver.acknowledge_at
        return (
            not self._sender.is_quiet
            or (acknowledge_at is not None and acknowledge_at <= self.now)
            or self._has_due_control()
        )

    def _has_due_control(self) -> bool:
        sender, resets, now = self._sender, self._resets, self.now
        return bool(
            self._control
            or sender.ambiguous
            or resets.answers
            or (sender.forward_at is not None and sender.forward_at <= now)
            or (resets.due_at is not None and resets.due_at <= now)
        )

    def _next_chunks(self) -> bytes:
        """Return the next packet's chunks: control first (RFC 9260 6.10); a pending SACK travels with data (6.2)."""
        sender, receiver, now = self._sender, self._receiver, self.now
        control = self._take_control(self._room) if self._has_due_control() else b""
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

    def _take_control(self, room: int) -> bytes:
        """Take the control chunks that fit; a larger one waits for the next packet."""
        self._add_due_control()
        taken = b""
        while self._control and len(taken) + len(self._control[0]) <= room:
            taken += self._control.pop(0)
        return taken

    def _add_due_control(self) -> None:
        sender, resets, now = self._sender, self._resets, self.now
        forward = sender.forward_tsn(now)
        if forward is not None:
            self._control.append(forward.encode())
        request = resets.next_request(sender.next_tsn - 1, now)
        if request is not None:
            resets.sent(now + self.round_trip.timeout(resets.tries))
            self._control.append(request.encode())
        if resets.answers:
            self._control += [Reconfig([answer]).encode() for answer in resets.answers]
            resets.answers.clear()
        if sender.ambiguous:
            sender.ambiguous = False
            if (heartbeat := self._heartbeats.ask(now)) is not None:
                self._control.append(heartbeat.encode())

    def _say(self, chunk: Chunk) -> None:
        """Queue an answer, which leaves with the next packet; drop it when too many wait."""
        if len(self._control) < MOST_CONTROL:
            self._control.append(chunk.encode())

    def _packet(self, chunks: bytes) -> bytes:
        tag = 0 if self._peer is None else self._peer.tag
        return encode_packet(self.settings.port, self._peer_port, tag, chunks)

    def _send_alone(self, tag: int, chunk: Chunk) -> None:
        self._packets.append(encode_packet(self.settings.port, self._peer_port, tag, chunk.encode()))

    def _send_cookie(self) -> None:
        """Send COOKIE ECHO, and as many messages as fit: nothing else leaves before the answer (RFC 9260 5.1 C)."""
        self._cookie_is_due = False
        echo = CookieEcho(self._cookie).encode()
        self._packets.append(self._packet(echo + self._sender.chunks(self._room - len(echo), self.now)))

    # Packets in

    def _refusal(self, packet: Packet) -> str:
        """Return the reason not to read a packet (RFC 9260 8.5); "" for a packet to read."""
        if packet.source != self._peer_port or packet.destination != self.settings.port:
            return "wrong_port"
        first = packet.chunks[0]
        if self._ended:
            if isinstance(first, ShutdownAck):  # 8.4 5: the one of this side was lost
                self._send_alone(packet.tag, ShutdownComplete(reflected=True))
            return "ended"
        if type(first) is Init:
            return "" if packet.tag == 0 and len(packet.chunks) == 1 else "wrong_tag"
        if isinstance(first, Abort | ShutdownComplete) and first.reflected:
            return "" if self._peer is not None and packet.tag == self._peer.tag else "wrong_tag"
        return "" if packet.tag == self._tag else "wrong_tag"

    def _report_unknown(self, chunk: Chunk) -> bool:
        """Report an unknown chunk. Return True to go on with the packet (RFC 9260 3.2)."""
        assert isinstance(chunk, Unknown)
        self.counts["unknown_chunk"] += 1
        if chunk.kind & 0x40 and self._peer is not None:
            self._say(Error([(UNRECOGNIZED_CHUNK, chunk.encode()[:MOST_REPORTED])]))
        return bool(chunk.kind & 0x80)

    def _receive_data(self, chunk: Data | InterleavedData) -> None:
        if not self._may_receive:
            self.counts["unexpected"] += 1
        elif not self._receiver.receive_data(chunk, self.now):
            self._say(Error([(INVALID_STREAM, chunk.stream.to_bytes(2, "big") + bytes(2))]))

    def _receive_forward_tsn(self, chunk: ForwardTsn | InterleavedForwardTsn) -> None:
        if self._may_receive:
            self._receiver.receive_forward_tsn(chunk, self.now)
        else:
            self.counts["unexpected"] += 1

    def _after_packet(self) -> None:
        receiver = self._receiver
        if receiver.packet_ends(self.now):
            if messages := receiver.messages:
                self._events += messages
                messages.clear()
            if events := self._resets.advanced(receiver.received.cumulative):
                self._take_reset_events(events)

    def _receive_sack(self, chunk: Sack) -> None:
        """Keep it until something is to be sent or timed: a message in the same packet may be a command, and goes on
        before it."""
        if self._is_up:
            self._take_late_sack()
            self._late_sack = chunk, self.now

    def _take_late_sack(self) -> None:
        if self._late_sack is not None:
            (chunk, now), self._late_sack = self._late_sack, None
            self._sender.receive_sack(chunk, now)

    def _receive_reconfig(self, chunk: Reconfig) -> None:
        if self._is_up:
            self._take_reset_events(self._resets.receive(chunk, self._receiver.received.cumulative, self.now))

    def _take_reset_events(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, StreamsReset):
                self._receiver.reassembly.reset(event.streams)
            elif isinstance(event, OutgoingStreamsReset) and event.done:
                self._sender.reset(event.streams)
        self._events += events

    # Round trip

    def _receive_heartbeat(self, chunk: Heartbeat) -> None:
        if self._is_up:
            self._say(HeartbeatAck(chunk.body))

    def _receive_heartbeat_ack(self, chunk: HeartbeatAck) -> None:
        seconds = self._heartbeats.answered(chunk, self.now)
        if seconds is not None:
            self.round_trip.sample(seconds, self.now)

    # Handshake

    def _send_init(self) -> None:
        self._send_alone(0, Init(*self._own_init(), own_parameters(self.settings)))
        self._repeat_later()

    def _own_init(self) -> tuple[int, int, int, int, int]:
        settings = self.settings
        return self._tag, settings.receive_window, MOST_STREAMS, settings.max_streams, self._initial_tsn

    def _repeat_later(self) -> None:
        """Start T1 or T2."""
        if self.state in (State.COOKIE_WAIT, State.COOKIE_ECHOED):
            interval = self.settings.initial_timeout * (1 << min(self._repeats, 16))
            self._repeat_at = self.now + min(interval, self.settings.handshake_ceiling)
        else:
            self._repeat_at = self.now + self.round_trip.timeout(self._repeats)
        if self._repeats == 0:
            self._asked_at = self.now

    def _repeat(self) -> None:
        """Repeat a chunk: T1 or T2 has expired (RFC 9260 5.1, 9.2)."""
        if self.state is State.COOKIE_WAIT:
            self._send_init()
            return
        if self.state is State.COOKIE_ECHOED:
            self._cookie_is_due = True
            self._sender.handle_timer(self.now)  # the messages in its packet
        elif self.state is State.SHUTDOWN_SENT:
            self._control.append(Shutdown(self._receiver.received.cumulative & MASK_32).encode())
        else:
            self._control.append(ShutdownAck().encode())
        self._repeat_later()

    def _answered(self) -> None:
        """Note the answer to the handshake's chunk, which measures a round trip if the chunk was sent once."""
        if self._repeats == 0:
            self.round_trip.sample(self.now - self._asked_at, self.now)
        self._repeats = 0
        self._repeat_at = None

    def _receive_init(self, chunk: Init) -> None:
        peer = read_init(chunk)
        if self._is_up and self._peer is not None and peer.tag != self._peer.tag:
            raise ProtocolViolation("peer_restarted")  # RFC 9260 5.2.2; see the class
        if self.state is State.SHUTDOWN_ACK_SENT:
            return
        # 5.1 B; 5.2.1 wants the same tag and TSN again where INITs collide, and so does a repeated INIT.
        cookie = (STATE_COOKIE, self._cookies.seal(peer, self.now))
        parameters = [cookie, *own_parameters(self.settings), *unrecognized(chunk.parameters)]
        self._send_alone(peer.tag, InitAck(*self._own_init(), parameters))

    def _receive_init_ack(self, chunk: InitAck) -> None:
        if self.state is not State.COOKIE_WAIT:
            self.counts["unexpected"] += 1  # RFC 9260 5.2.3
            return
        peer = read_init(chunk)
        cookie = next((value for kind, value in chunk.parameters if kind == STATE_COOKIE), b"")
        if not cookie:
            raise ProtocolViolation("init_invalid")  # 3.3.3: the one mandatory parameter
        self._answered()
        self._know(peer)
        self._cookie = cookie
        self._cookie_is_due = True
        self._become(State.COOKIE_ECHOED)
        self._repeat_later()

    def _receive_cookie_echo(self, chunk: CookieEcho) -> None:
        """Take COOKIE ECHO: RFC 9260 5.1 D and the table of 5.2.4, without a restart (A), since INIT ends on that."""
        opened = self._cookies.open(chunk.body)
        if opened is None:
            self.counts["bad_cookie"] += 1
            return
        peer, made = opened
        if self._is_up or self.state is State.SHUTDOWN_ACK_SENT:
            if self._peer is not None and peer.tag == self._peer.tag and self.state is State.ESTABLISHED:
                self._say(CookieAck())  # D: the answer was lost
            return
        if self._cookies.is_stale(made, self.now):
            self._send_alone(peer.tag, Error([(STALE_COOKIE, _word.pack(0))]))
            return
        if self._peer is None or peer.tag != self._peer.tag:
            self._know(peer)
        self._control.insert(0, CookieAck().encode())
        self._be_established()

    def _receive_cookie_ack(self, chunk: CookieAck) -> None:
        if self.state is State.COOKIE_ECHOED:
            self._answered()
            self._be_established()

    def _know(self, peer: PeerInit) -> None:
        settings = self.settings
        self._peer = peer
        interleaving = settings.interleaving and peer.interleaving
        self._receiver = Receiver(settings, peer.initial_tsn, interleaving, self.counts)
        self._resets = StreamReset(self._initial_tsn, peer.initial_tsn)
        self._sender.peer_is(peer.window, interleaving=interleaving, partial_reliability=peer.partial_reliability)

    def _be_established(self) -> None:
        self._become(State.ESTABLISHED)
        self._repeat_at = None
        self._repeats = 0
        self._cookie_is_due = False
        if self.round_trip.smoothed is None:
            self._sender.ambiguous = True
        peer = self._peer
        assert peer is not None
        self._events.append(Established(peer.inbound_streams, self.settings.interleaving and peer.interleaving))

    # The end

    def _go_on_shutting_down(self) -> None:
        """Send SHUTDOWN, or the answer to it, when everything has arrived (RFC 9260 9.2)."""
        self._take_late_sack()
        if not self._sender.idle:
            return
        if self.state is State.SHUTDOWN_PENDING:
            self._become(State.SHUTDOWN_SENT)
            self._control.append(Shutdown(self._receiver.received.cumulative & MASK_32).encode())
        elif self.state is State.SHUTDOWN_RECEIVED:
            self._become(State.SHUTDOWN_ACK_SENT)
            self._control.append(ShutdownAck().encode())
        else:
            return
        self._repeats = 0
        self._repeat_later()

    def _receive_shutdown(self, chunk: Shutdown) -> None:
        if self.state in (State.ESTABLISHED, State.SHUTDOWN_PENDING, State.SHUTDOWN_SENT):  # the last: both at once
            self._become(State.SHUTDOWN_RECEIVED)
            self._go_on_shutting_down()

    def _receive_shutdown_ack(self, chunk: ShutdownAck) -> None:
        if self.state in (State.SHUTDOWN_SENT, State.SHUTDOWN_ACK_SENT) and self._peer is not None:
            self._send_alone(self._peer.tag, ShutdownComplete())
            self._end("closed")

    def _receive_shutdown_complete(self, chunk: ShutdownComplete) -> None:
        if self.state is State.SHUTDOWN_ACK_SENT:
            self._end("peer_closed")

    def _receive_abort(self, chunk: Abort) -> None:
        causes = [kind for kind, _ in chunk.causes]
        reason = "peer_closed" if USER_ABORT in causes else "peer_aborted"
        self._end(reason, " ".join(f"cause {cause}" for cause in causes[:8]))

    def _receive_error(self, chunk: Error) -> None:
        self.counts["error_from_peer"] += 1
        if self.state is State.COOKIE_ECHOED and any(kind == STALE_COOKIE for kind, _ in chunk.causes):
            self._become(State.COOKIE_WAIT)  # RFC 9260 5.2.6: begin anew
            self._cookie_is_due = False
            self._repeats = 0
            self._send_init()

    def _violated(self, reason: str) -> None:
        if self._peer is not None:
            self._send_alone(self._peer.tag, Abort([(PROTOCOL_VIOLATION, reason.encode())]))
        self._end(reason)

    def _end(self, reason: str, detail: str = "") -> None:
        self._events += self._receiver.messages
        self._receiver = Receiver(self.settings, 0, False, self.counts)
        self._ended = True
        self._become(State.CLOSED)
        self._repeat_at = None
        self._control.clear()
        self._sender.clear()
        self._late_sack = None
        self._events.append(Closed(reason, detail))
