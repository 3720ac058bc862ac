"""Private parts of aiortc and aioice; tests/client/test_aiortc_private.py pins each of them. Those of an ICE restart
are in client/ice_restart_private.py; nothing else in client/ touches any.

Why each is needed:

- aiortc neither offers nor reads foreign header extensions, and gives no packet to its user;
- it does not note the SSRCs of retransmissions: with two sections of one codec it drops them all (RFC 4588 8.1);
- its receiver decodes in a thread that is no daemon, into queues without bound, and gives out a frame only when
  the next one begins;
- aioice takes data for a STUN message by their length alone, and then raises what its caller does not expect;
- aioice never gathers loopback, and takes its STUN and TURN servers before anybody could ask the console for them;
- aioice closes a connection after six checks whose answers took over half a second, as all do on a long path;
- its SCTP waits at least one second before it repeats a lost message, three while it connects, and then sends one
  packet at a time; it acknowledges every single packet;
- its DTLS takes one record from OpenSSL for each datagram that comes in. A record that waits there, as one that
  overtook the end of the handshake does, is never caught up with: from then on every message is one datagram late.
"""

import asyncio
import contextlib
import struct
from collections import deque
from collections.abc import Callable, Sequence
from types import MethodType
from typing import Any, Protocol

import aioice.stun
import pylibsrtp
from aioice.ice import Connection, StunProtocol, TransportPolicy
from aiortc import RTCIceServer, RTCPeerConnection, RTCRtpReceiver
from aiortc.rtcdtlstransport import RTCDtlsTransport
from aiortc.rtcicetransport import connection_kwargs
from aiortc.rtcsctptransport import USERDATA_MAX_LENGTH
from aiortc.rtp import HeaderExtensions, HeaderExtensionsMap, RtpPacket, is_rtcp
from OpenSSL import SSL

from client.frame_assembler import MediaPacket
from client.rtp_header import find_extension
from robot_bridge.protocol.carriers import unpack_capture_moment
from robot_bridge.protocol.ice_consent import keep_consent, require_consent_hooks

__all__ = [
    "PacketSink",
    "drain_dtls",
    "gather_here",
    "gather_only_on",
    "hasten_sctp",
    "keep_path",
    "send_control",
    "take_packets",
    "take_raw_rtp",
    "tell_data_from_stun",
    "transport_of",
    "use_ice_servers",
]

require_consent_hooks(Connection, StunProtocol)

LAST_OF_STUN = b"\x03"  # the largest first byte of its messages
RETRANSMISSION_FLOOR = 0.3  # s; above a browser's delayed acknowledgement (0.2 s, RFC 9260 6.2)
RETRANSMISSION_CEILING = 1.5  # s; on a path whose shortest round trip is longer than half of it, twice that
SAMPLES = 8  # of the round trip, of which the shortest is the path's and not an outage's
ACKNOWLEDGEMENT_DELAY = 0.15  # s; RFC 9260 6.2 allows 0.5 and recommends 0.2
RETRANSMISSION_START = 0.5  # s before the first measured round trip
CONNECT_CEILING = 3.0  # s, to which the interval grows while nobody answers; aiortc gives up after eight
RECORD = 1500  # bytes, the most that a DTLS record carries here
WINDOW_FLOOR = 8 * USERDATA_MAX_LENGTH  # bytes that may be unacknowledged after a timeout


class PacketSink(Protocol):
    """Takes the packets of one media section."""

    def packet(self, payload_type: int, packet: MediaPacket) -> bool:
        """Take one; whether to ask the sender for a keyframe."""

    def missing(self) -> list[int]:
        """Sequence numbers to ask the sender for again."""


def transport_of(pc: RTCPeerConnection) -> RTCDtlsTransport:
    """The one transport: all sections are bundled."""
    transceivers = pc.getTransceivers()
    if transceivers:
        return transceivers[0].receiver.transport
    if pc.sctp is None:
        raise RuntimeError("add the transceivers and data channels first")
    return pc.sctp.transport


_parse_message = aioice.stun.parse_message  # aioice's own


def _parse_or_refuse(data: bytes) -> aioice.stun.Message:
    if data[:1] > LAST_OF_STUN:  # RFC 7983 section 7; also spares every RTP packet the attempt
        raise ValueError("not STUN")
    try:
        return _parse_message(data)
    except struct.error as error:
        raise ValueError("a STUN attribute of the wrong length") from error


def tell_data_from_stun() -> None:
    """What is no STUN message after all passes for data, process-wide: an RTP packet whose number is its length."""
    aioice.stun.parse_message = _parse_or_refuse


def gather_only_on(pc: RTCPeerConnection, addresses: Sequence[str]) -> None:
    """Gather host candidates on exactly these addresses, loopback included. Call before setLocalDescription."""
    gather_here(transport_of(pc).transport.iceGatherer._connection, addresses)


def gather_here(connection: Any, addresses: Sequence[str]) -> None:
    """The same for one ICE connection of aioice."""
    gather = connection.get_component_candidates
    chosen = list(addresses)

    async def gather_chosen(component: int, addresses: list[str]) -> Any:
        return await gather(component=component, addresses=chosen)

    connection.get_component_candidates = gather_chosen


def keep_path(pc: RTCPeerConnection, on_expired: Callable[[], None] = lambda: None) -> None:
    """Take the other side's answers to ICE checks for valid however late they come. Call before setLocalDescription.

    `on_expired`: there was none for 30 s, and the connection closes.
    """
    keep_consent(transport_of(pc).transport.iceGatherer._connection, on_expired)


def use_ice_servers(pc: RTCPeerConnection, servers: list[RTCIceServer], *, relay_only: bool) -> None:
    """Ask these for addresses too; `relay_only`: use no other. Call before setLocalDescription."""
    connection: Any = transport_of(pc).transport.iceGatherer._connection
    for name, value in connection_kwargs(servers).items():
        setattr(connection, name, value)
    if relay_only:
        connection._transport_policy = TransportPolicy.RELAY


class _StampMap(HeaderExtensionsMap):
    """Header extensions with the value that carries the event reference."""

    def __init__(self, extension_id: int | None) -> None:
        super().__init__()
        self._stamp_id = extension_id

    def get(self, extension_profile: int, extension_value: bytes) -> HeaderExtensions:
        try:
            values = super().get(extension_profile, extension_value)
        except struct.error as error:
            # aiortc drops a packet on ValueError only; anything else ends its receive loop.
            raise ValueError("a header extension has the wrong length") from error
        stamp: Any = values
        if self._stamp_id is not None:
            stamp.event_reference = find_extension(extension_profile, extension_value, self._stamp_id)
        return values


class _PacketTap:
    """Stands in for a receiver's jitter buffer: every packet leaves here, none is kept."""

    def __init__(self, sink: PacketSink, read_stamp: Callable[[bytes], int | None]) -> None:
        self._sink = sink
        self._read_stamp = read_stamp
        self.ssrc: int | None = None  # of the media, not of the retransmissions

    def add(self, packet: RtpPacket) -> tuple[bool, None]:
        self.ssrc = packet.ssrc
        value = getattr(packet.extensions, "event_reference", None)
        data: bytes = packet._data  # type: ignore[attr-defined]
        stamp = self._read_stamp(value) if value is not None else None
        captured = unpack_capture_moment(value) if value is not None else None
        taken = MediaPacket(packet.sequence_number, packet.timestamp, bool(packet.marker), data, stamp, captured)
        return self._sink.packet(packet.payload_type, taken), None


def take_packets(
    pc: RTCPeerConnection,
    sinks: dict[str, PacketSink],
    extension_id: int | None,
    read_stamp: Callable[[bytes], int | None],
) -> None:
    """Give the packets of each media section to the sink of its mid; nothing is decoded or kept by aiortc.

    Call before setRemoteDescription(answer). aiortc goes on sending receiver reports, REMB and the first request
    for a lost packet.
    """
    transport: Any = transport_of(pc)
    transport._rtp_header_extensions_map = _StampMap(extension_id)
    for transceiver in pc.getTransceivers():
        sink = sinks.get(transceiver.mid or "")
        if sink is not None:
            _tap(transceiver.receiver, _PacketTap(sink, read_stamp), sink)


def _tap(receiver: Any, tap: _PacketTap, sink: PacketSink) -> None:
    handle = receiver._handle_rtp_packet
    begin = receiver.receive

    async def handle_and_ask(packet: RtpPacket, arrival_time_ms: int) -> None:
        await handle(packet, arrival_time_ms=arrival_time_ms)
        missing = sink.missing()
        if missing and tap.ssrc is not None:
            await receiver._send_rtcp_nack(tap.ssrc, sorted(missing))  # aiortc cannot pack them in another order

    async def receive(self: RTCRtpReceiver, parameters: Any) -> None:
        await begin(parameters)
        receiver._handle_disconnect()  # ends the decoder thread, which has had nothing to do
        # Sections of one codec share the payload type of retransmissions, so that only the SSRC tells whose they are.
        for encoding in parameters.encodings:
            if encoding.rtx is not None:
                receiver.transport._rtp_router.ssrc_table[encoding.rtx.ssrc] = receiver

    receiver._RTCRtpReceiver__jitter_buffer = tap
    receiver._handle_rtp_packet = handle_and_ask
    receiver.receive = MethodType(receive, receiver)


class _RtpShortCut(asyncio.Queue[tuple[bytes, int] | None]):
    """Stands in for an ICE connection's receive queue: RTP is decrypted and taken as it comes.

    Its way through the queue and the coroutines behind it costs several times as much as all the rest.
    """

    def __init__(self, transport: Any, take: Callable[[bytes], None]) -> None:
        super().__init__()
        self._transport = transport
        self._take = take

    def put_nowait(self, item: tuple[bytes, int] | None) -> None:
        session = self._transport._rx_srtp
        if item is None or session is None or not 127 < item[0][0] < 192 or is_rtcp(item[0]):
            super().put_nowait(item)
            return
        with contextlib.suppress(pylibsrtp.Error):  # not from the console
            self._take(session.unprotect(item[0]))


def take_raw_rtp(pc: RTCPeerConnection, take: Callable[[bytes], None], control: Callable[[bytes], None]) -> None:
    """Give every decrypted RTP packet to `take`, and RTCP packets to `control`, and do nothing else with them.

    No thread, no buffer; reports are sent with `send_control`. Call before the connection is up.
    """
    transport: Any = transport_of(pc)
    transport.transport.iceGatherer._connection._queue = _RtpShortCut(transport, take)

    async def handle(data: bytes, arrival_time_ms: int) -> None:
        take(data)

    async def handle_control(data: bytes) -> None:
        control(data)

    async def receive(parameters: Any) -> None:
        """Not even registered: the packets do not come this way."""

    transport._handle_rtp_data = handle
    transport._handle_rtcp_data = handle_control
    for transceiver in pc.getTransceivers():
        receiver: Any = transceiver.receiver
        receiver.receive = receive


async def send_control(pc: RTCPeerConnection, packet: bytes) -> None:
    """Send an RTCP packet; nothing while the connection is not up."""
    transport: Any = transport_of(pc)
    with contextlib.suppress(ConnectionError):
        await transport._send_rtp(packet)


def drain_dtls(pc: RTCPeerConnection) -> None:
    """With every datagram, take all records that OpenSSL has, not only the first."""
    sctp: Any = pc.sctp
    handle = sctp._handle_data

    async def handle_all(data: bytes) -> None:
        await handle(data)
        while (more := _next_record(sctp.transport)) is not None:
            await handle(more)

    sctp._handle_data = handle_all


def _next_record(transport: Any) -> bytes | None:
    try:
        record: bytes = transport._ssl.recv(RECORD)
    except SSL.ZeroReturnError as error:
        raise ConnectionError("the remote closed DTLS") from error
    except SSL.Error:
        return None  # nothing more
    return record or None


def hasten_sctp(pc: RTCPeerConnection) -> None:
    """Let SCTP find out about a loss sooner, and go on sending after one.

    A console sends some kilobytes a second, so that neither a timeout of less than a second (RFC 9260 16 leaves
    RTO.Min to the application's needs) nor a window of a few packets after a timeout can congest a path.
    """
    sctp: Any = pc.sctp
    measure, expire, transmit = sctp._update_rto, sctp._t3_expired, sctp._transmit
    expire_connecting = sctp._t1_expired

    samples: deque[float] = deque(maxlen=SAMPLES)

    def update(round_trip: float) -> None:
        measure(round_trip)
        samples.append(round_trip)
        # A network that was cut and delivers everything at its end is no path of ten seconds: with a wait of that
        # order, whatever is lost next would keep the operator from the seat for as long.
        ceiling = max(RETRANSMISSION_CEILING, 2 * min(samples))
        sctp._rto = min(max(RETRANSMISSION_FLOOR, sctp._srtt + 4 * sctp._rttvar), ceiling)

    def expired_connecting() -> None:
        # The wait grows: eight short ones would end before a path that was gone for five seconds is back.
        sctp._rto = min(2 * sctp._rto, CONNECT_CEILING)
        expire_connecting()

    def expired() -> None:
        expire()
        sctp._cwnd = max(sctp._cwnd, WINDOW_FLOOR)

    async def transmit_or_not() -> None:
        # A timer may fire while the connection closes; aiortc runs this in a task that nobody awaits.
        with contextlib.suppress(ConnectionError, SSL.Error):  # it has ended, or its goodbye was said just now
            await transmit()

    sctp._rto = RETRANSMISSION_START
    sctp._cwnd = max(sctp._cwnd, WINDOW_FLOOR)
    sctp._update_rto = update
    sctp._t1_expired = expired_connecting
    sctp._t3_expired = expired
    sctp._transmit = transmit_or_not
    _delay_acknowledgements(sctp)


def _delay_acknowledgements(sctp: Any) -> None:
    """Acknowledge every second packet, or after a while (RFC 9260 6.2), as browsers do; aiortc does each.

    At once when something is missing or came twice: the sender is to find out soon. A console with a hundred
    observers spends much of its time on what they acknowledge.
    """
    acknowledge = sctp._send_sack
    timer: asyncio.TimerHandle | None = None

    async def acknowledge_late() -> None:
        with contextlib.suppress(ConnectionError, SSL.Error):  # the connection ends meanwhile
            await acknowledge()

    def late() -> None:
        nonlocal timer
        timer = None
        if sctp.state == "connected":
            sctp._late_acknowledgement = asyncio.ensure_future(acknowledge_late())

    async def acknowledge_soon() -> None:
        nonlocal timer
        if timer is None and not sctp._sack_misordered and not sctp._sack_duplicates:
            sctp._sack_needed = False
            timer = asyncio.get_running_loop().call_later(ACKNOWLEDGEMENT_DELAY, late)
            return
        if timer is not None:
            timer.cancel()
            timer = None
        await acknowledge()

    sctp._send_sack = acknowledge_soon
