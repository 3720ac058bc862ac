"""Takes published pictures off one media section; aiortc's receiver would decode them in a thread, into unbound queues.

What is used of aiortc, pinned by tests: `RTCRtpReceiver.receive`, `.stop`, `._handle_rtp_packet`,
`._handle_rtcp_packet`, `._handle_disconnect`; `RTCDtlsTransport._register_rtp_receiver`, `._unregister_rtp_receiver`,
`._send_rtp`; `RTCRtpTransceiver._codecs`, `._headerExtensions`.
"""

import secrets
from collections.abc import Callable
from contextlib import suppress
from typing import Any, cast

from aiortc import RTCRtpTransceiver
from aiortc.rtcrtpreceiver import StreamStatistics
from aiortc.rtp import (
    RTCP_PSFB_APP,
    RTCP_PSFB_PLI,
    RTCP_RTPFB_NACK,
    AnyRtcpPacket,
    RtcpPsfbPacket,
    RtcpReceiverInfo,
    RtcpRrPacket,
    RtcpRtpfbPacket,
    RtcpSrPacket,
    RtpPacket,
    pack_remb_fci,
    unwrap_rtx,
)

from server.media.codec_choice_private import keep_codec
from server.media.published.depacketise import PictureCodec
from server.media.published.picture_assembly import MediaPacket
from server.run_now import run_now

__all__ = ["PictureSection", "take_pictures"]

CODECS: tuple[PictureCodec, ...] = ("H264", "VP8")
CLOCK_RATE = 90_000
SDES_MID = ":sdes:mid"


class PictureSection:
    """One section from which pictures come. `codec` is what was answered."""

    def __init__(
        self, transceiver: RTCRtpTransceiver, codec: PictureCodec, take: Callable[[MediaPacket], None]
    ) -> None:
        self.codec = codec
        self.foreign = 0  # packets of another source than the first that came
        self._take = take
        self._receiver: Any = transceiver.receiver
        self._payload_type: int = transceiver._codecs[0].payloadType or 0
        self._repair_types = {each.payloadType for each in transceiver._codecs[1:]}
        self._ssrc: int | None = None  # of the pictures; None before the first
        self._own_ssrc = secrets.randbits(32)
        self._statistics = StreamStatistics(CLOCK_RATE)
        self._sender_report: tuple[int, float] | None = None  # middle of its NTP time, and when it came
        self._registered = False

    def install(self, clock: Callable[[], float]) -> None:
        """Stand in for what aiortc's receiver would do. `clock` is monotonic, in s."""
        receiver = self._receiver

        async def receive(parameters: Any) -> None:
            if not self._registered:
                self._registered = True
                receiver.transport._register_rtp_receiver(receiver, parameters)

        async def stop() -> None:
            if self._registered:
                self._registered = False
                receiver.transport._unregister_rtp_receiver(receiver)

        async def handle(packet: RtpPacket, arrival_time_ms: int) -> None:
            self._packet(packet)

        async def control(packet: AnyRtcpPacket) -> None:
            if isinstance(packet, RtcpSrPacket) and packet.ssrc == self._ssrc:
                self._sender_report = (packet.sender_info.ntp_timestamp >> 16) & 0xFFFFFFFF, clock()

        receiver.receive, receiver.stop = receive, stop
        receiver._handle_rtp_packet, receiver._handle_rtcp_packet = handle, control
        receiver._handle_disconnect = lambda: None

    def request_packets(self, sequences: list[int]) -> None:
        """Ask for these once more (RFC 4585 6.2.1)."""
        if self._ssrc is not None and sequences:
            self._send(RtcpRtpfbPacket(RTCP_RTPFB_NACK, self._own_ssrc, self._ssrc, sorted(sequences)))

    def request_keyframe(self) -> None:
        """Picture loss indication (RFC 4585 6.3.1)."""
        if self._ssrc is not None:
            self._send(RtcpPsfbPacket(RTCP_PSFB_PLI, self._own_ssrc, self._ssrc))

    def report(self, most_bps: int, now: float) -> None:
        """A receiver report, and how much may be sent at most."""
        statistics = self._statistics
        if self._ssrc is None or statistics.max_seq is None:
            return
        last, since = (0, 0) if self._sender_report is None else self._report_age(self._sender_report, now)
        report = RtcpReceiverInfo(
            ssrc=self._ssrc,
            fraction_lost=statistics.fraction_lost,
            packets_lost=statistics.packets_lost,
            highest_sequence=(statistics.cycles + statistics.max_seq) & 0xFFFFFFFF,
            jitter=statistics.jitter & 0xFFFFFFFF,
            lsr=last,
            dlsr=since,
        )
        estimate = RtcpPsfbPacket(RTCP_PSFB_APP, self._own_ssrc, 0, pack_remb_fci(most_bps, [self._ssrc]))
        self._send(RtcpRrPacket(self._own_ssrc, [report]), estimate)

    @staticmethod
    def _report_age(report: tuple[int, float], now: float) -> tuple[int, int]:
        last, came = report
        return last, min(0xFFFFFFFF, int((now - came) * 65_536))

    def _packet(self, packet: RtpPacket) -> None:
        if packet.payload_type in self._repair_types and self._ssrc is not None:
            if len(packet.payload) <= 2:
                return  # padding, to probe the path
            packet = unwrap_rtx(packet, payload_type=self._payload_type, ssrc=self._ssrc)
        elif packet.payload_type != self._payload_type or packet.ssrc != (self._ssrc or packet.ssrc):
            self.foreign += 1
            return
        else:
            self._ssrc = packet.ssrc
            self._statistics.add(packet)
        self._take(MediaPacket(packet.sequence_number, packet.timestamp, bool(packet.marker), packet.payload))

    def _send(self, *packets: Any) -> None:
        transport = self._receiver.transport
        if transport.state == "connected":
            with suppress(ConnectionError):  # its end is told otherwise
                run_now(transport._send_rtp(b"".join(map(bytes, packets))))


def take_pictures(
    transceiver: RTCRtpTransceiver, take: Callable[[MediaPacket], None], clock: Callable[[], float]
) -> PictureSection | None:
    """Answer that pictures of this section are taken, and give each packet to `take`; None: no codec in common.

    Call after setRemoteDescription(offer), before createAnswer.
    """
    codec = keep_codec(transceiver, CODECS)
    if codec is None:
        return None
    transceiver._headerExtensions = [each for each in transceiver._headerExtensions if each.uri.endswith(SDES_MID)]
    transceiver.direction = "recvonly"
    section = PictureSection(transceiver, cast(PictureCodec, codec), take)
    section.install(clock)
    return section
