"""Pins what receiver_private.py relies on, and what it does with packets."""

import inspect
import time
from typing import Any

import pytest
from aiortc import RTCPeerConnection, RTCRtpReceiver, RTCSessionDescription
from aiortc.rtcdtlstransport import RTCDtlsTransport
from aiortc.rtp import (
    RTCP_PSFB_PLI,
    RTCP_RTPFB_NACK,
    RtcpPacket,
    RtcpPsfbPacket,
    RtcpRrPacket,
    RtcpRtpfbPacket,
    RtcpSenderInfo,
    RtcpSrPacket,
    RtpPacket,
    unpack_remb_fci,
    wrap_rtx,
)

from server.media.aiortc_private import create_peer_connection
from server.media.published.picture_assembly import MediaPacket
from server.media.published.receiver_private import PictureSection, take_pictures
from tests.server.media.published.publishing import TestPublisher

MOVED = "aiortc moved a private part: see server/media/published/receiver_private.py"


def test_the_private_parts_that_are_replaced_and_called_are_there() -> None:
    for name in ("receive", "stop", "_handle_rtp_packet", "_handle_rtcp_packet", "_handle_disconnect"):
        assert callable(getattr(RTCRtpReceiver, name, None)), MOVED
    for name in ("_register_rtp_receiver", "_unregister_rtp_receiver", "_send_rtp", "_handle_rtp_data"):
        assert callable(getattr(RTCDtlsTransport, name, None)), MOVED
    assert list(inspect.signature(RTCDtlsTransport._handle_rtp_data).parameters) == ["self", "data", "arrival_time_ms"]


class Section:
    """A section that was answered, packets that are given to it, and the reports that leave it."""

    def __init__(self, section: PictureSection, receiver: Any, took: list[MediaPacket]) -> None:
        self.section = section
        self.receiver = receiver
        self.took = took
        self.sent: list[Any] = []

        class Transport:
            state = "connected"

            async def _send_rtp(_, data: bytes) -> None:
                self.sent += RtcpPacket.parse(data)

        section._receiver = self
        self.transport = Transport()
        self.payload_type = section._payload_type
        [self.repair_type] = [each or 0 for each in section._repair_types]

    def packet(self, sequence: int, *, ssrc: int = 7, payload_type: int | None = None) -> RtpPacket:
        kind = self.payload_type if payload_type is None else payload_type
        return RtpPacket(payload_type=kind, marker=1, sequence_number=sequence, timestamp=90, ssrc=ssrc, payload=b"ab")

    async def give(self, packet: RtpPacket) -> None:
        await self.receiver._handle_rtp_packet(packet, 0)


@pytest.fixture
async def section() -> Any:
    pc = create_peer_connection()
    took: list[MediaPacket] = []
    async with TestPublisher() as publisher:
        await pc.setRemoteDescription(RTCSessionDescription(await publisher.offer(), "offer"))
        transceiver = pc.getTransceivers()[0]
        found = take_pictures(transceiver, took.append, time.monotonic)
        assert found is not None
        yield Section(found, transceiver.receiver, took)
    await pc.close()


async def test_packets_of_the_first_source_and_their_repetitions_are_taken_and_no_others(section: Section) -> None:
    await section.give(section.packet(1))
    await section.give(wrap_rtx(section.packet(2), payload_type=section.repair_type, sequence_number=9, ssrc=8))
    await section.give(section.packet(3, ssrc=99))
    await section.give(section.packet(4, payload_type=section.payload_type + 30))
    padding = section.packet(5, payload_type=section.repair_type)
    padding.payload = b""
    await section.give(padding)
    assert section.took == [MediaPacket(1, 90, True, b"ab"), MediaPacket(2, 90, True, b"ab")]
    assert section.section.foreign == 2


async def test_what_is_asked_of_the_publisher_is_what_rfc_4585_says(section: Section) -> None:
    section.section.request_keyframe()
    section.section.request_packets([1])
    section.section.report(1_000_000, 0.0)
    assert section.sent == [], "nobody is there to be asked"
    await section.give(section.packet(10))
    section.section.request_keyframe()
    section.section.request_packets([13, 11, 40])
    section.section.request_packets([])
    keyframe, missing = section.sent
    assert isinstance(keyframe, RtcpPsfbPacket)
    assert (keyframe.fmt, keyframe.media_ssrc) == (RTCP_PSFB_PLI, 7)
    assert isinstance(missing, RtcpRtpfbPacket)
    assert (missing.fmt, missing.media_ssrc, missing.lost) == (RTCP_RTPFB_NACK, 7, [11, 13, 40])


async def test_a_report_answers_the_publishers_own_and_bounds_its_rate(section: Section) -> None:
    await section.give(section.packet(10))
    info = RtcpSenderInfo(ntp_timestamp=0x1234_5678_9ABC_DEF0, rtp_timestamp=0, packet_count=1, octet_count=1)
    await section.receiver._handle_rtcp_packet(RtcpSrPacket(ssrc=7, sender_info=info))
    section.section.report(2_000_000, time.monotonic() + 1.0)
    report, estimate = section.sent
    assert isinstance(report, RtcpRrPacket)
    [each] = report.reports
    assert (each.ssrc, each.highest_sequence, each.lsr) == (7, 10, 0x5678_9ABC)
    assert each.dlsr >= 65_536
    assert isinstance(estimate, RtcpPsfbPacket)
    bitrate, sources = unpack_remb_fci(estimate.fci)
    assert bitrate <= 2_000_000 < bitrate * 1.01
    assert sources == [7]


async def test_without_a_codec_in_common_nothing_is_taken() -> None:
    pc = create_peer_connection()
    client = RTCPeerConnection()
    client.addTransceiver("audio", direction="sendonly")
    await client.setLocalDescription(await client.createOffer())
    await pc.setRemoteDescription(RTCSessionDescription(client.localDescription.sdp, "offer"))
    assert take_pictures(pc.getTransceivers()[0], lambda packet: None, time.monotonic) is None
    await pc.close()
    await client.close()
