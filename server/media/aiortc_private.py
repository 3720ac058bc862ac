"""Private parts of aiortc and aioice under media and ICE; tests pin every one of them.

Those under the data channels are in `server/data_transport_private.py`; what peers send is
guarded in `server/media/receive_guard_private.py` and `server/peer_guards_private.py`, ICE restarts are in
`server/ice_restart_private.py`, codecs in `server/media/codec_choice_private.py`; nothing else in the server touches
any.

What is used and why:

- `aioice.ice.get_host_addresses`: aioice never gathers loopback addresses and has no setting for them
- `RTCRtpTransceiver.__sender`, `._codecs`, `._headerExtensions`, `._offerDirection`: the answer is built from them
- `RTCRtpSender`'s attributes that `RTCPeerConnection` reads: `_ssrc`, `_rtx_ssrc`, `_stream_id`, `_track_id`
- `RTCDtlsTransport._tx_srtp`, `._state`, `._register_rtp_sender`: ready packets go out without a coroutine each
- `aioice.Connection._nominated`: the selected path
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Protocol

import aioice.ice
import pylibsrtp
from aiortc import (
    RTCBundlePolicy,
    RTCConfiguration,
    RTCIceServer,
    RTCPeerConnection,
    RTCRtpSender,
    RTCRtpTransceiver,
)
from aiortc.rtcdtlstransport import State
from aiortc.rtcrtpparameters import RTCRtpHeaderExtensionParameters, RTCRtpSendParameters
from aiortc.rtp import (
    RTCP_PSFB_APP,
    RTCP_PSFB_FIR,
    RTCP_PSFB_PLI,
    RTCP_RTPFB_NACK,
    AnyRtcpPacket,
    RtcpPsfbPacket,
    RtcpRrPacket,
    RtcpRtpfbPacket,
    RtcpSrPacket,
    unpack_remb_fci,
)
from aiortc.sdp import SessionDescription

from server.media.frame import EncodedFrame
from server.media.header_extensions import LARGEST_ID, ExtensionWriter
from server.media.pacer import Pacer
from server.media.packet_stream import PacketStream, SenderStats, StreamParameters

__all__ = [
    "MediaSender",
    "ReceptionListener",
    "close_or_force",
    "create_peer_connection",
    "install_sender",
    "keep_extensions",
    "offered_direction",
    "offered_extensions",
    "restrict_ice_hosts",
]

SOCKET_BACKLOG_BYTES = 64 * 1024  # a peer with more unsent bytes than this gets no more frames for now
MOST_PATIENCE = 1.0  # s that a keyframe request waits for retransmissions
MOST_EXPECTED = 100_000  # packets between two reports of a peer


def restrict_ice_hosts(addresses: Sequence[str]) -> None:
    """Make ICE gather host candidates on exactly these addresses, loopback included. Process-wide."""
    chosen = list(addresses)

    def get_host_addresses(use_ipv4: bool, use_ipv6: bool) -> list[str]:
        return [address for address in chosen if (use_ipv6 if ":" in address else use_ipv4)]

    aioice.ice.get_host_addresses = get_host_addresses


def create_peer_connection(ice_servers: Sequence[RTCIceServer] = ()) -> RTCPeerConnection:
    """A peer connection that contacts no STUN and TURN servers but these.

    Each section of an offer starts with a transport of its own: with a shared one aiortc would keep the candidates
    of the last section only, and browsers put them all into the first.
    """
    return RTCPeerConnection(RTCConfiguration(iceServers=list(ice_servers), bundlePolicy=RTCBundlePolicy.MAX_COMPAT))


async def close_or_force(pc: RTCPeerConnection) -> None:
    """Close `pc`. Where that raises, its sockets are closed all the same, and then it is raised."""
    try:
        await pc.close()
    except Exception:
        await _close_transports(pc)
        raise


async def _close_transports(pc: RTCPeerConnection) -> None:
    """Not `pc.close` again, which after an error waits for ever."""
    dtls = {transceiver.receiver.transport for transceiver in pc.getTransceivers()}
    if pc.sctp is not None:
        dtls.add(pc.sctp.transport)
    for stop in (*(each.stop for each in dtls), *(each.transport.stop for each in dtls)):
        with suppress(Exception):  # what remains is closed all the same
            await stop()


def offered_extensions(offer_sdp: str) -> dict[str, dict[str, int]]:
    """Header extensions of each media section of an offer, as far as a packet can carry them: URI to id, by mid."""
    sections = SessionDescription.parse(offer_sdp).media
    return {
        m.rtp.muxId: {each.uri: each.id for each in m.rtp.headerExtensions if 1 <= each.id <= LARGEST_ID}
        for m in sections
    }


def offered_direction(transceiver: RTCRtpTransceiver) -> str | None:
    """What the offer lets us do in this section: "sendonly", "sendrecv", "recvonly" or "inactive"."""
    return transceiver._offerDirection


def keep_extensions(transceiver: RTCRtpTransceiver, ids: Mapping[str, int]) -> None:
    """Answer exactly these header extensions, with the offer's ids."""
    transceiver._headerExtensions = [RTCRtpHeaderExtensionParameters(id=x, uri=uri) for uri, x in ids.items()]


def install_sender(transceiver: RTCRtpTransceiver, sender: "MediaSender") -> None:
    """Make `transceiver` answer and send with `sender`."""
    old = transceiver.sender
    sender._ssrc, sender._rtx_ssrc = old._ssrc, old._rtx_ssrc
    # The name is mangled because aiortc has no way to bring a sender of one's own.
    if not hasattr(transceiver, "_RTCRtpTransceiver__sender"):
        raise RuntimeError("aiortc moved RTCRtpTransceiver.__sender; see server/media/aiortc_private.py")
    setattr(transceiver, "_RTCRtpTransceiver__sender", sender)  # noqa: B010


class ReceptionListener(Protocol):
    """Hears what a peer says about what it receives."""

    def reception(self, sender: "MediaSender", lost: int, expected: int, round_trip: float | None) -> None:
        """Packets since its last report about this stream; the round trip in s if the report tells one."""

    def bandwidth(self, bitrate_bps: int, ssrcs: frozenset[int]) -> None:
        """Its estimate for these streams together (REMB)."""


class MediaSender(RTCRtpSender):
    """Sends ready frames. Owns no task: whoever created it pushes frames and asks for reports."""

    def __init__(
        self,
        transceiver: RTCRtpTransceiver,
        stream_id: str,
        *,
        trailer: bool,
        on_ready: Callable[[], None],
        on_keyframe_request: Callable[[], None],
        on_stopped: Callable[[], None],
        listener: ReceptionListener | None = None,
        pacer: Pacer | None = None,
        on_paced: Callable[[], None] = lambda: None,
        on_failed: Callable[[str, Exception], None] | None = None,
    ) -> None:
        """`on_failed` gets the stage and what was raised where aiortc would only lose it; without, it is raised."""
        super().__init__(transceiver.kind, transceiver.receiver.transport)
        self._stream_id = stream_id
        self._trailer = trailer
        self._on_ready = on_ready
        self._on_keyframe_request = on_keyframe_request
        self._on_stopped = on_stopped
        self._listener = listener
        self._pacer = pacer  # None: nothing is held back
        self._on_paced = on_paced
        self._on_failed = on_failed
        self.paced = False  # whether packets wait for the pacer
        self._repeats: deque[bytes] = deque()  # retransmissions that the pacer holds back; they go first
        self._rest: deque[bytes] = deque()  # packets of the last frame that it holds back
        self._patience: asyncio.TimerHandle | None = None  # of a keyframe request that waits for a retransmission
        self._packets: PacketStream | None = None  # None before the transport is connected
        self._pair: Any = None  # the selected one, as far as it was looked at
        self._way: tuple[Any, tuple[str, int]] | None = None  # through it
        self._stopped = False

    @property
    def stats(self) -> SenderStats:
        return self._packets.stats if self._packets is not None else SenderStats()

    async def send(self, parameters: RTCRtpSendParameters) -> None:
        """Called by the peer connection when the transport is connected; again on every renegotiation."""
        with self._contained("answer"):
            self._begin(parameters)

    @contextmanager
    def _contained(self, stage: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:
            if self._on_failed is None:
                raise
            self._on_failed(stage, error)

    def _begin(self, parameters: RTCRtpSendParameters) -> None:
        if self._packets is not None or self._stopped:
            return
        codec = parameters.codecs[0]
        if codec.payloadType is None:
            raise RuntimeError("aiortc negotiated a codec without a payload type")
        rtx = [c.payloadType for c in parameters.codecs[1:] if c.parameters.get("apt") == codec.payloadType]
        negotiated = StreamParameters(
            ssrc=self._ssrc,
            rtx_ssrc=self._rtx_ssrc,
            payload_type=codec.payloadType,
            rtx_payload_type=rtx[0] if rtx else None,
            clock_rate=codec.clockRate,
            cname=parameters.rtcp.cname or "",
            trailer=self._trailer,
        )
        ids = {extension.uri: extension.id for extension in parameters.headerExtensions}
        self._packets = PacketStream(negotiated, ExtensionWriter(ids, parameters.muxId))
        self.transport._register_rtp_sender(self, parameters)
        self._on_ready()

    async def stop(self) -> None:
        """Called by the peer connection when it closes. Idempotent."""
        if self._stopped:
            return
        self._stopped = True
        self._repeats.clear()
        self._rest.clear()
        self.paced = False
        if self._patience is not None:
            self._patience.cancel()
        if self._packets is not None:
            self.transport._unregister_rtp_sender(self)
            self._send_control(self._packets.goodbye(time.time()))
        self._on_stopped()

    def transmit(self, frame: EncodedFrame) -> tuple[int, int] | None:
        """Send a frame now: packets and bytes handed to the network, (0, 0) when the transport is gone.

        None, and nothing is sent, while the socket holds so much that another frame would only queue. What the pacer
        holds back of it is left for `flush`.
        """
        path = self._path()
        if path is None or self._packets is None:
            return 0, 0
        transport, address = path
        if _backlog(transport) > SOCKET_BACKLOG_BYTES:
            return None
        packets = self._packets.packets(frame, time.time())
        if self._pacer is not None:
            count = self._pacer.admit(packets, time.monotonic())
            if count < len(packets):
                self._rest.extend(packets[count:])
                self.paced = True
                packets = packets[:count]
        return self._send_all(packets, transport, address)

    def _send_all(self, packets: Sequence[bytes], transport: Any, address: tuple[str, int]) -> tuple[int, int]:
        sendto = transport.sendto
        protect = self.transport._tx_srtp.protect
        octets = 0
        try:
            for packet in packets:
                protected = protect(packet)
                octets += len(protected)
                sendto(protected, address)
        except (pylibsrtp.Error, ValueError, OSError):
            self.stats.failed += 1
            return 0, 0
        return len(packets), octets

    def flush(self) -> tuple[int, int]:
        """Send what the pacer lets through of what waits: packets and bytes handed to the network."""
        path = self._path()
        if path is None or self._packets is None or self._pacer is None:
            self._rest.clear()
            self._repeats.clear()
            self.paced = False
            return 0, 0
        packets, octets, now = 0, 0, time.time()
        for waiting in (self._repeats, self._rest):
            count = self._pacer.admit(waiting, time.monotonic())
            leaving = [self._packets.stamp_send_time(waiting.popleft(), now) for _ in range(count)]
            sent = self._send_all(leaving, *path)
            packets, octets = packets + sent[0], octets + sent[1]
        self.paced = bool(self._rest or self._repeats)
        return packets, octets

    def report(self) -> None:
        """Send a sender report, if anything was sent yet."""
        if self._packets is not None and not self._stopped:
            self._send_control(self._packets.report(time.time()))

    def _path(self) -> tuple[Any, tuple[str, int]] | None:
        """The selected pair's datagram transport and remote address; None unless connected (RFC 8445 12.1)."""
        dtls = self.transport
        if dtls._state is not State.CONNECTED:
            return None
        pair = dtls.transport._connection._nominated.get(1)
        if pair is not self._pair:  # for every packet, so it is taken apart only once
            self._pair, self._way = pair, None if pair is None else (pair.protocol.transport, pair.remote_addr)
        return self._way

    def _send_control(self, packet: bytes | None) -> None:
        path = self._path()
        if packet is None or path is None:
            return
        try:
            path[0].sendto(self.transport._tx_srtp.protect_rtcp(packet), path[1])
        except (pylibsrtp.Error, OSError):
            self.stats.failed += 1

    async def _handle_rtcp_packet(self, packet: AnyRtcpPacket) -> None:
        with self._contained("rtcp"):
            self._take_rtcp(packet)

    def _take_rtcp(self, packet: AnyRtcpPacket) -> None:
        if self._packets is None:
            return
        if isinstance(packet, RtcpRrPacket | RtcpSrPacket):
            self._take_reports(packet)
        elif isinstance(packet, RtcpRtpfbPacket) and packet.fmt == RTCP_RTPFB_NACK:
            self._retransmit_all(packet.lost)
        elif isinstance(packet, RtcpPsfbPacket) and packet.fmt in (RTCP_PSFB_PLI, RTCP_PSFB_FIR):
            self._packets.stats.keyframe_requests += 1
            self._keyframe_requested()
        elif isinstance(packet, RtcpPsfbPacket) and packet.fmt == RTCP_PSFB_APP:
            bitrate, ssrcs = unpack_remb_fci(packet.fci)
            if self._ssrc in ssrcs:
                self._packets.stats.remb_bps = bitrate
                if self._listener is not None:
                    self._listener.bandwidth(bitrate, frozenset(ssrcs))

    def _keyframe_requested(self) -> None:
        """A peer that lacks packets asks for both, them and a keyframe: the keyframe waits while they may arrive."""
        if self._patience is not None or self._packets is None:
            return
        wait = min(MOST_PATIENCE, self._packets.repair_time(time.time()))
        if wait <= 0:
            self._on_keyframe_request()
            return

        def serve() -> None:
            self._patience = None
            with self._contained("rtcp"):
                self._on_keyframe_request()

        self._patience = asyncio.get_running_loop().call_later(wait, serve)

    def _take_reports(self, packet: RtcpRrPacket | RtcpSrPacket) -> None:
        for block in packet.reports:
            if block.ssrc == self._ssrc and self._packets is not None:
                stats = self._packets.stats
                before = stats.highest_sequence, stats.packets_lost
                round_trip = self._packets.reported(
                    highest_sequence=block.highest_sequence,
                    fraction_lost=block.fraction_lost,
                    packets_lost=block.packets_lost,
                    jitter=block.jitter,
                    last_report=block.lsr,
                    delay=block.dlsr,
                    now=time.time(),
                )
                expected, lost = block.highest_sequence - before[0], block.packets_lost - before[1]
                if not 0 < expected <= MOST_EXPECTED or before[0] == 0:
                    expected = lost = 0  # the first report, one that was overtaken, or nonsense
                if self._listener is not None:
                    self._listener.reception(self, min(max(0, lost), expected), expected, round_trip)

    def _retransmit_all(self, lost: Sequence[int]) -> None:
        path = self._path()
        if path is None or self._packets is None:
            return
        now = time.time()
        for sequence_number in lost:
            packet = self._packets.retransmission(sequence_number, now)
            if packet is None:
                continue
            if self._pacer is None or (not self._repeats and self._pacer.admit((packet,), time.monotonic())):
                self._send_all((packet,), *path)
            else:
                self._repeats.append(packet)  # bounded by the history's budget
                self.paced = True
                self._on_paced()


def _backlog(transport: Any) -> int:
    """Bytes that wait for the socket; the transports of TURN cannot tell."""
    size: Callable[[], int] | None = getattr(transport, "get_write_buffer_size", None)
    return 0 if size is None else size()
