"""One SCTP association over DTLS (RFC 9260, RFC 8261), without I/O."""

from collections import Counter
from collections.abc import Callable
from typing import Any

from lockstep.rtc.sctp.data_transfer import DataTransfer
from lockstep.rtc.sctp.errors import AssociationClosed, MessageTooLarge, ProtocolViolation, SctpParseError
from lockstep.rtc.sctp.events import Event
from lockstep.rtc.sctp.handshake import Handshake
from lockstep.rtc.sctp.lifecycle import Lifecycle, State
from lockstep.rtc.sctp.packets import Packets
from lockstep.rtc.sctp.peer_init import Cookies
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.sending.send_queue import Message
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.shutdown import GracefulShutdown
from lockstep.rtc.sctp.wire.chunks import (
    Abort,
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
)
from lockstep.rtc.sctp.wire.packet import decode_packet
from lockstep.rtc.sctp.wire.parameters import PROTOCOL_VIOLATION, USER_ABORT, Parameter

__all__ = ["Association"]

_WILL_BE_UP = frozenset({State.CLOSED, State.COOKIE_WAIT, State.COOKIE_ECHOED})


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
        self.max_message = min(settings.max_send_message, peer_max_message or settings.max_send_message)
        self.now = 0.0  # the last time that was handed in
        self.round_trip = RoundTrip(settings)
        tag = int.from_bytes(random_bytes(4), "big") or 1
        cookies = Cookies(random_bytes(32), settings.cookie_lifetime)
        tsn = int.from_bytes(random_bytes(4), "big")
        lifecycle = self._lifecycle = Lifecycle()
        packets = self._packets = Packets(
            settings.port, settings.port if peer_port is None else peer_port, tag, self.counts
        )
        transfer = self._transfer = DataTransfer(settings, tsn, lifecycle, packets, self.round_trip, self.counts)
        handshake = self._handshake = Handshake(
            settings, tsn, cookies, lifecycle, packets, transfer, self.round_trip, self.counts
        )
        shutdown = self._shutdown = GracefulShutdown(lifecycle, packets, transfer, self.round_trip)
        self._queue = transfer.sender.queue
        self._handlers: dict[type, Callable[[Any, float], None]] = {
            Data: transfer.receive_data,
            InterleavedData: transfer.receive_data,
            Sack: transfer.receive_sack,
            Init: handshake.receive_init,
            InitAck: handshake.receive_init_ack,
            CookieEcho: handshake.receive_cookie_echo,
            CookieAck: handshake.receive_cookie_ack,
            Heartbeat: transfer.heartbeats.receive,
            HeartbeatAck: transfer.heartbeats.receive_ack,
            ForwardTsn: transfer.receive_forward_tsn,
            InterleavedForwardTsn: transfer.receive_forward_tsn,
            Reconfig: transfer.receive_reconfig,
            Abort: lifecycle.receive_abort,
            Error: handshake.receive_error,
            Shutdown: shutdown.receive_shutdown,
            ShutdownAck: shutdown.receive_shutdown_ack,
            ShutdownComplete: shutdown.receive_shutdown_complete,
        }

    @property
    def state(self) -> State:
        return self._lifecycle.state

    # Methods for the owner

    def start(self, now: float) -> None:
        """Begin the handshake, when the peer has not done so already."""
        self.now = now
        if self._lifecycle.state is State.CLOSED and self._lifecycle.closed is None:
            self._handshake.start(now)

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
        lifecycle = self._lifecycle
        if lifecycle.state is not State.ESTABLISHED and (lifecycle.closed or lifecycle.state not in _WILL_BE_UP):
            raise AssociationClosed("the association has ended")
        if not payload:
            raise ValueError("an SCTP message has at least one byte")
        if len(payload) > self.max_message:
            raise MessageTooLarge(f"{len(payload)} of at most {self.max_message} bytes")
        expires = None if lifetime is None else now + lifetime
        self._queue.put(Message(stream, protocol, payload, ordered, max_retransmits, expires))

    def buffered(self, stream: int) -> int:
        """Return the number of bytes that wait on this stream, without newest-wins messages."""
        return self._queue.buffered(stream)

    def has_waiting(self, stream: int) -> bool:
        """True if a message waits on this stream that has not begun to leave."""
        return self._queue.has(stream)

    def reset_streams(self, streams: tuple[int, ...], now: float) -> bool:
        """Reset these outgoing streams, on which nothing waits. Return False if the peer cannot (RFC 6525 5.1.1)."""
        self.now = now
        peer = self._transfer.peer
        if self._lifecycle.closed is not None or peer is None or not peer.reconfiguration:
            return False
        self._transfer.resets.ask(streams, now)
        return True

    def shutdown(self, now: float) -> None:
        """End when everything has arrived (RFC 9260 9.2). Messages that arrive meanwhile are still received."""
        self.now = now
        if self._lifecycle.closed is None and self._shutdown.begin(now):
            self._transfer.end()

    def abort(self, now: float, reason: str = "aborted") -> None:
        """End at once, and tell the peer (RFC 9260 9.1). `reason` comes back in `Closed`."""
        self.now = now
        if self._lifecycle.closed is None:
            self._abort((USER_ABORT, b""), reason)

    def _abort(self, cause: Parameter, reason: str) -> None:
        if self._packets.peer_tag:
            self._packets.send_alone(self._packets.peer_tag, Abort([cause]))
        self._lifecycle.end(reason)
        self._transfer.end()

    # The interface of every core

    def receive_packet(self, data: bytes, now: float) -> None:
        """Take a packet from DTLS. Nothing is raised: bad input is dropped and counted, or ends the association."""
        self.now = now
        lifecycle = self._lifecycle
        try:
            packet = decode_packet(data)
        except SctpParseError:
            self.counts["malformed"] += 1
            return
        refused = self._packets.refusal(packet, ended=lifecycle.closed is not None)
        if refused:
            self.counts[refused] += 1
            return
        try:
            for chunk in packet.chunks:
                handler = self._handlers.get(type(chunk))
                if handler is not None:
                    handler(chunk, now)
                elif not self._packets.report_unknown(chunk):
                    break
                if lifecycle.closed is not None:
                    self._transfer.end()
                    return
        except ProtocolViolation as violation:
            self._abort((PROTOCOL_VIOLATION, violation.reason.encode()), violation.reason)
            return
        self._transfer.packet_ends(now)

    def packets_to_send(self) -> list[bytes]:
        """Return every due packet, as of the last `now`. SACK and data share packets."""
        lifecycle, packets, transfer = self._lifecycle, self._packets, self._transfer
        if lifecycle.closed is None:
            transfer.take_late_sack()
            if lifecycle.is_up:
                if lifecycle.state is not State.ESTABLISHED:
                    self._shutdown.go_on(self.now)
                transfer.bundle(self.now)
            elif self._handshake.cookie_is_due:
                self._handshake.send_cookie(self.now)
            elif lifecycle.state is State.SHUTDOWN_ACK_SENT and packets.control:
                packets.send(transfer.take_control(self.settings.max_packet, self.now))
        return packets.take()

    def timer(self) -> float | None:
        """Return the time at which `handle_timer` is due; None: never."""
        if self._lifecycle.closed is not None:
            return None
        transfer = self._transfer
        transfer.take_late_sack()
        due = self._handshake.repeat_at if self._handshake.repeat_at is not None else self._shutdown.repeat_at
        if self._lifecycle.is_up:
            due = transfer.sender.timer.deadline(due)
            for each in (
                transfer.receiver.acknowledge_at,
                transfer.resets.due_at,
                transfer.sender.partial.forward_at,  # one that is due at once counts as past
            ):
                if each is not None and (due is None or each < due):
                    due = each
        return due

    def handle_timer(self, now: float) -> None:
        """Repeat unacknowledged chunks. They leave with `packets_to_send`."""
        self.now = now
        if self._lifecycle.closed is not None:
            return
        self._transfer.take_late_sack()
        self._handshake.handle_timer(now)
        self._shutdown.handle_timer(now)
        if self._lifecycle.is_up:
            self._transfer.sender.handle_timer(now)

    def events(self) -> list[Event]:
        """Return the events since the last call."""
        events, self._transfer.events = self._transfer.events, []
        return events
