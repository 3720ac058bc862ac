"""Pins the private parts of aiortc and aioice that client/aiortc_private.py builds on: an upgrade that moves one of
them fails here, by name."""

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import aioice.stun
import pytest
from aiortc import (
    RTCBundlePolicy,
    RTCConfiguration,
    RTCDataChannel,
    RTCPeerConnection,
    RTCRtpSender,
    RTCSessionDescription,
)
from aiortc.mediastreams import AudioStreamTrack, VideoStreamTrack
from aiortc.rtcsctptransport import SackChunk
from aiortc.rtp import RtcpRrPacket, RtpPacket
from aiortc.sdp import SessionDescription

from client import aiortc_private
from client.aiortc_private import (
    drain_dtls,
    gather_only_on,
    hasten_sctp,
    send_control,
    take_packets,
    take_raw_rtp,
    tell_data_from_stun,
    transport_of,
)
from client.frame_assembler import MediaPacket
from client.receiver_reports import ReceiverReports
from client.rtp_header import parse_rtp_header
from client.sdp import offer_extension, read_sections
from robot_bridge.protocol.carriers import EVENT_REFERENCE_URI, unpack_event_reference

SECONDS = 15


def new_peer(*kinds: str) -> RTCPeerConnection:
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[], bundlePolicy=RTCBundlePolicy.MAX_BUNDLE))
    for kind in kinds:
        pc.addTransceiver(kind, direction="recvonly")
    return pc


@asynccontextmanager
async def connected(
    offerer: RTCPeerConnection,
    *tracks: VideoStreamTrack | AudioStreamTrack,
    before_answer: Callable[[RTCPeerConnection], None] = lambda pc: None,
) -> AsyncIterator[tuple[RTCDataChannel, RTCDataChannel]]:
    """`offerer` connected to a plain aiortc peer that sends `tracks`; both ends of a data channel."""
    answerer = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    there: asyncio.Future[RTCDataChannel] = asyncio.get_running_loop().create_future()
    answerer.on("datachannel", there.set_result)
    opened = asyncio.Event()
    here = offerer.createDataChannel("control", ordered=False, maxRetransmits=0)
    here.on("open", opened.set)
    try:
        async with asyncio.timeout(SECONDS):
            gather_only_on(offerer, ["127.0.0.1"])
            await offerer.setLocalDescription(await offerer.createOffer())
            await answerer.setRemoteDescription(offerer.localDescription)
            for track in tracks:
                answerer.addTrack(track)
            gather_only_on(answerer, ["127.0.0.1"])
            await answerer.setLocalDescription(await answerer.createAnswer())
            before_answer(offerer)
            await offerer.setRemoteDescription(answerer.localDescription)
            await opened.wait()
            yield here, await there
    finally:
        await offerer.close()
        await answerer.close()


class Sink:
    """Keeps the packets of one section."""

    def __init__(self) -> None:
        self.packets: list[MediaPacket] = []
        self.enough = asyncio.Event()

    def packet(self, payload_type: int, packet: MediaPacket) -> bool:
        self.packets.append(packet)
        if len(self.packets) >= 5:
            self.enough.set()
        return False

    def missing(self) -> list[int]:
        return []


def decoder_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.endswith("-decoder")]


@pytest.mark.parametrize(
    "attribute",
    [
        "_RTCRtpReceiver__jitter_buffer",
        "_RTCRtpReceiver__decoder_thread",
        "_handle_rtp_packet",
        "_handle_disconnect",
        "_send_rtcp_nack",
        "receive",
    ],
)
async def test_a_receiver_has(attribute: str) -> None:
    pc = new_peer("video")
    assert hasattr(pc.getTransceivers()[0].receiver, attribute)
    await pc.close()


@pytest.mark.parametrize("attribute", ["_rtp_header_extensions_map", "_handle_rtp_data", "_ssl", "_data_receiver"])
async def test_a_dtls_transport_has(attribute: str) -> None:
    pc = new_peer("video")
    transport = pc.getTransceivers()[0].receiver.transport
    if attribute == "_ssl":
        assert "_ssl" in type(transport).start.__code__.co_names
    else:
        assert hasattr(transport, attribute)
    await pc.close()


@pytest.mark.parametrize(
    "attribute",
    ["_rto", "_cwnd", "_srtt", "_rttvar", "_update_rto", "_t3_expired", "_transmit", "_handle_data", "transport"]
    + ["_send_sack", "_sack_needed", "_sack_misordered", "_sack_duplicates", "_send_chunk"],
)
async def test_sctp_has(attribute: str) -> None:
    pc = new_peer()
    pc.createDataChannel("control")
    assert hasattr(pc.sctp, attribute)
    await pc.close()


async def test_only_the_given_addresses_are_gathered() -> None:
    pc = new_peer("video")
    gather_only_on(pc, ["127.0.0.1"])
    await pc.setLocalDescription(await pc.createOffer())
    candidates = [line for line in pc.localDescription.sdp.splitlines() if line.startswith("a=candidate:")]
    await pc.close()
    assert candidates
    assert all(" 127.0.0.1 " in line for line in candidates)


async def test_a_connection_without_anything_to_carry_is_a_mistake() -> None:
    pc = new_peer()
    with pytest.raises(RuntimeError):
        gather_only_on(pc, ["127.0.0.1"])
    await pc.close()


async def test_the_offered_extension_survives_the_local_description() -> None:
    pc = new_peer("video", "audio")
    gather_only_on(pc, ["127.0.0.1"])
    offer = await pc.createOffer()
    await pc.setLocalDescription(RTCSessionDescription(offer_extension(offer.sdp, EVENT_REFERENCE_URI), "offer"))
    sections = read_sections(pc.localDescription.sdp)
    await pc.close()
    assert all(EVENT_REFERENCE_URI in section.extensions for section in sections)


async def test_packets_reach_their_sink_and_nothing_is_decoded() -> None:
    pc = new_peer("video", "audio")
    video, audio = Sink(), Sink()

    def take(pc: RTCPeerConnection) -> None:
        take_packets(pc, {"0": video, "1": audio}, None, unpack_event_reference)

    async with connected(pc, VideoStreamTrack(), AudioStreamTrack(), before_answer=take):
        await video.enough.wait()
        await audio.enough.wait()
        assert decoder_threads() == []
    assert any(packet.marker for packet in video.packets)
    assert all(packet.stamp is None for packet in video.packets)
    assert all(packet.data for packet in audio.packets)


async def test_a_retransmission_finds_its_section_among_several_of_one_codec() -> None:
    pc = new_peer("video", "video")
    sinks = {"0": Sink(), "1": Sink()}

    def take(pc: RTCPeerConnection) -> None:
        take_packets(pc, dict(sinks), None, unpack_event_reference)

    async with connected(pc, VideoStreamTrack(), VideoStreamTrack(), before_answer=take):
        for sink in sinks.values():
            await sink.enough.wait()
        router: Any = transport_of(pc)._rtp_router
        for transceiver in pc.getTransceivers():
            description = next(
                m for m in SessionDescription.parse(pc.remoteDescription.sdp).media if m.rtp.muxId == transceiver.mid
            )
            rtx = next(codec.payloadType or 0 for codec in description.rtp.codecs if codec.name == "rtx")
            packet = RtpPacket(payload_type=rtx, ssrc=description.ssrc[1].ssrc, payload=b"\x00\x01")
            assert router.route_rtp(packet) is transceiver.receiver


async def test_raw_packets_come_without_threads_or_receivers_and_can_be_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pc = new_peer("video")
    taken: list[bytes] = []
    enough = asyncio.Event()

    def count(data: bytes) -> None:
        taken.append(data)
        if len(taken) >= 5:
            enough.set()

    reports = ReceiverReports(77)
    reported = asyncio.Event()

    def control(data: bytes) -> None:
        reports.control(data, time.monotonic())
        reported.set()

    heard = asyncio.Event()

    async def hear(sender: RTCRtpSender, packet: Any) -> None:
        if isinstance(packet, RtcpRrPacket) and packet.reports[0].lsr:
            heard.set()

    monkeypatch.setattr(RTCRtpSender, "_handle_rtcp_packet", hear)
    async with (
        asyncio.timeout(SECONDS),
        connected(pc, VideoStreamTrack(), before_answer=lambda pc: take_raw_rtp(pc, count, control)),
    ):
        dtls: Any = transport_of(pc)
        queue = dtls.transport._connection._queue
        forged = bytes([0x80, 97]) + bytes(30)
        await enough.wait()
        queue.put_nowait((forged, 1))
        assert queue.empty()  # neither kept nor taken
        assert decoder_threads() == []
        header = parse_rtp_header(taken[0])
        assert header is not None
        reports.add(header.ssrc, 90_000)
        reports.packet(header, time.monotonic())
        await reported.wait()  # aiortc's own sender report
        report = reports.report(time.monotonic())
        assert report is not None
        await send_control(pc, report)
        await heard.wait()
    assert all(parse_rtp_header(data) is not None for data in taken)
    assert forged not in taken


@pytest.mark.parametrize(("first", "why"), [(0x90, "not STUN"), (0x00, "wrong length")], ids=["RTP", "STUN"])
def test_data_that_looks_like_stun_is_not_taken_for_it(first: int, why: str) -> None:
    attribute = bytes([0x00, 0x24, 0x00, 0x02]) + bytes(4)  # PRIORITY has four bytes
    lookalike = bytes([first, 0x60, 0x00, len(attribute)]) + bytes(16) + attribute
    tell_data_from_stun()
    with pytest.raises(ValueError, match=why):
        aioice.stun.parse_message(lookalike)


def test_the_stamp_is_read_beside_the_other_extensions() -> None:
    stamps = aiortc_private._StampMap(5)
    header = bytes([0x90, 97]) + (1).to_bytes(2, "big") + (2).to_bytes(4, "big") + (3).to_bytes(4, "big")
    extension = bytes([0x53]) + (77).to_bytes(4, "big") + bytes(3)
    packet = header + (0xBEDE).to_bytes(2, "big") + (2).to_bytes(2, "big") + extension + b"payload"
    parsed: Any = RtpPacket.parse(packet, stamps).extensions
    assert unpack_event_reference(parsed.event_reference) == 77


def test_an_extension_of_the_wrong_length_drops_the_packet_and_no_more() -> None:
    stamps = aiortc_private._StampMap(5)
    parameters: Any = type("Parameters", (), {})()
    extension: Any = type("Extension", (), {})()
    extension.id, extension.uri = 3, "http://www.webrtc.org/experiments/rtp-hdrext/abs-send-time"
    parameters.headerExtensions = [extension]
    stamps.configure(parameters)
    with pytest.raises(ValueError, match="wrong length"):
        stamps.get(0xBEDE, bytes([0x30, 1, 0, 0]))


async def test_every_record_of_a_datagram_is_delivered() -> None:
    pc = new_peer()
    received: asyncio.Queue[str] = asyncio.Queue(10)
    async with connected(pc, before_answer=drain_dtls) as (here, there):
        here.on("message", received.put_nowait)
        transport: Any = there.transport.transport
        write, held, both = transport._write_ssl, [], asyncio.Event()

        async def hold() -> None:
            held.append(1)
            if len(held) == 2:
                both.set()

        transport._write_ssl = hold
        for text in ("first", "second"):
            there.send(text)
        await both.wait()
        transport._write_ssl = write
        await write()
        async with asyncio.timeout(0.5):  # sooner than SCTP would repeat the second
            assert [await received.get(), await received.get()] == ["first", "second"]


async def test_the_end_of_dtls_is_still_noticed() -> None:
    pc = new_peer()
    closed = asyncio.Event()
    async with connected(pc, before_answer=drain_dtls) as (here, there):
        here.on("close", closed.set)
        await there.transport.transport.stop()
        await closed.wait()


async def test_a_lost_message_is_found_out_sooner_and_does_not_shut_the_window() -> None:
    pc = new_peer()
    async with connected(pc, before_answer=hasten_sctp) as (here, there):
        answers: asyncio.Queue[str] = asyncio.Queue(10)
        there.on("message", answers.put_nowait)
        here.send("measure")
        await answers.get()
        sctp: Any = pc.sctp
        assert aiortc_private.RETRANSMISSION_FLOOR <= sctp._rto < 1
        sctp._t3_cancel()
        sctp._t3_expired()
        assert sctp._cwnd >= aiortc_private.WINDOW_FLOOR
        sctp._update_rto(10.0)
        assert sctp._rto == aiortc_private.RETRANSMISSION_CEILING
        for _ in range(8):
            sctp._update_rto(1.8)
        assert 1.8 < sctp._rto <= 3.6


async def test_the_wait_for_an_answer_to_the_connection_grows_and_does_not_give_up_after_seconds() -> None:
    pc = new_peer()
    pc.createDataChannel("x")
    hasten_sctp(pc)
    sctp: Any = pc.sctp
    waits = []
    for _ in range(8):
        waits.append(sctp._rto)
        sctp._t1_failures = 8  # the next one would be sent by a task
        sctp._t1_expired()
    assert waits == [0.5, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]
    await pc.close()


async def test_every_second_message_is_acknowledged_at_once_and_a_single_one_after_a_while() -> None:
    pc = new_peer()
    async with connected(pc, before_answer=hasten_sctp) as (here, there):
        got: asyncio.Queue[str] = asyncio.Queue(10)
        here.on("message", got.put_nowait)
        sctp: Any = pc.sctp
        acknowledged: list[int] = []
        told = asyncio.Event()
        send = sctp._send_chunk

        async def note(chunk: Any) -> None:
            if isinstance(chunk, SackChunk):
                acknowledged.append(chunk.cumulative_tsn)
                told.set()
            await send(chunk)

        sctp._send_chunk = note
        there.send("zero")  # its acknowledgement takes what the opening of the channel left over along
        await got.get()
        await told.wait()
        acknowledged.clear()
        told.clear()
        for text in "one", "two":
            there.send(text)
            await got.get()
        await told.wait()
        assert len(acknowledged) == 1
        told.clear()
        there.send("three")
        await got.get()
        assert len(acknowledged) == 1
        await told.wait()
        assert len(acknowledged) == 2
