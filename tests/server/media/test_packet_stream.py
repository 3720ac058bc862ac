import struct
from itertools import pairwise

import pytest
from aiortc.rtp import RtcpByePacket, RtcpPacket, RtcpSdesPacket, RtcpSrPacket, RtpPacket

from robot_bridge.protocol.carriers import EVENT_REFERENCE_URI
from server.media.frame import EncodedFrame
from server.media.header_extensions import ExtensionWriter
from server.media.packet_stream import PacketStream, StreamParameters
from server.media.sent_history import KEEP_SECONDS

UNIX = 1_790_000_000.0
NTP = 2_208_988_800


def stream(rtx: int | None = 98, extensions: bool = True) -> PacketStream:
    parameters = StreamParameters(
        ssrc=1111,
        rtx_ssrc=2222,
        payload_type=97,
        rtx_payload_type=rtx,
        clock_rate=90_000,
        cname="console",
        trailer=False,
    )
    return PacketStream(parameters, ExtensionWriter({EVENT_REFERENCE_URI: 4} if extensions else {}, "0"))


def frame(number: int, packets: int = 3, marker: bool = True) -> EncodedFrame:
    return EncodedFrame(
        b"",
        lambda data, trailer: [b"%d.%d" % (number, i) for i in range(packets)],
        keyframe=False,
        marker=marker,
        stamp=number,
        capture_time=UNIX + number / 30,
        media_time=number * 3000,
    )


def test_packets_are_numbered_without_a_gap_and_the_last_of_a_picture_is_marked() -> None:
    source = stream()
    packets = [RtpPacket.parse(data) for i in range(1, 4) for data in source.packets(frame(i), UNIX)]
    numbers = [packet.sequence_number for packet in packets]
    assert all((later - earlier) % 65536 == 1 for earlier, later in pairwise(numbers))
    assert [packet.marker for packet in packets] == [0, 0, 1] * 3
    assert {packet.ssrc for packet in packets} == {1111}
    assert {packet.payload_type for packet in packets} == {97}
    assert [packet.payload for packet in packets[:3]] == [b"1.0", b"1.1", b"1.2"]
    steps = [(packet.timestamp - packets[0].timestamp) % 2**32 for packet in packets]
    assert steps == [0] * 3 + [3000] * 3 + [6000] * 3


def test_the_first_number_is_in_the_lower_half() -> None:
    assert all(RtpPacket.parse(stream().packets(frame(1), UNIX)[0]).sequence_number < 0x8000 for _ in range(50))


def test_numbers_wrap() -> None:
    source = stream()
    numbers = [RtpPacket.parse(d).sequence_number for i in range(1, 700) for d in source.packets(frame(i, 100), UNIX)]
    assert all((later - earlier) % 65536 == 1 for earlier, later in pairwise(numbers))
    again = source.retransmission(numbers[-5], 0.0)
    assert again is not None
    assert RtpPacket.parse(again).payload[2:] == b"699.95"


@pytest.mark.parametrize("index", [0, 1, 2])
def test_a_retransmission_wraps_the_same_payload_and_extension(index: int) -> None:
    source = stream()
    source.packets(frame(1), UNIX)
    original = source.packets(frame(2), UNIX)[index]
    source.packets(frame(3), UNIX)
    number = RtpPacket.parse(original).sequence_number
    again = source.retransmission(number, 0.0)
    assert again is not None
    packet = RtpPacket.parse(again)
    assert (packet.payload_type, packet.ssrc, packet.marker) == (98, 2222, index == 2)
    assert packet.payload == struct.pack("!H", number) + b"2.%d" % index
    assert again[12:-5] == original[12:-3]  # the extension block
    second = source.retransmission(number, 1.0)
    assert second is not None
    assert (RtpPacket.parse(second).sequence_number - packet.sequence_number) % 65536 == 1


def test_without_rtx_the_packet_itself_is_sent_again() -> None:
    source = stream(rtx=None)
    original = source.packets(frame(1), UNIX)[2]
    assert source.retransmission(RtpPacket.parse(original).sequence_number, 0.0) == original


def test_without_extensions_there_is_no_extension_block() -> None:
    source = stream(extensions=False)
    data = source.packets(frame(1), UNIX)[0]
    assert data[0] == 0x80
    assert data[12:] == b"1.0"
    again = source.retransmission(RtpPacket.parse(data).sequence_number, 0.0)
    assert again is not None
    assert again[0] == 0x80


def test_what_was_forgotten_is_counted() -> None:
    source = stream()
    first = RtpPacket.parse(source.packets(frame(1), UNIX)[0]).sequence_number
    source.packets(frame(2), UNIX + KEEP_SECONDS + 1)
    assert source.retransmission(first, 0.0) is None
    assert source.retransmission(first - 1, 0.0) is None
    assert source.stats.not_retransmitted == 2


def test_a_report_maps_capture_times_to_rtp_timestamps() -> None:
    source = stream()
    timestamp = RtpPacket.parse(source.packets(frame(30), UNIX + 1.2)[0]).timestamp
    data = source.report(UNIX + 1.5)  # the picture was captured at UNIX + 1
    assert data is not None
    report, names = RtcpPacket.parse(data)
    assert isinstance(report, RtcpSrPacket)
    info = report.sender_info
    assert info.ntp_timestamp / 2**32 == pytest.approx(UNIX + 1.5 + NTP, abs=1e-4)
    assert (info.rtp_timestamp - timestamp) % 2**32 == 45_000
    assert (info.packet_count, info.octet_count) == (3, 12)
    assert isinstance(names, RtcpSdesPacket)
    assert names.chunks[0].items == [(1, b"console")]


def test_nothing_is_reported_before_the_first_frame() -> None:
    assert stream().report(UNIX) is None
    assert stream().goodbye(UNIX) is None


def test_goodbye_ends_a_compound_packet() -> None:
    source = stream()
    source.packets(frame(1), UNIX)
    data = source.goodbye(UNIX)
    assert data is not None
    *_, last = RtcpPacket.parse(data)
    assert last == RtcpByePacket(sources=[1111])


def test_a_receiver_report_gives_loss_jitter_and_round_trip_time() -> None:
    source = stream()
    source.packets(frame(1), UNIX)
    data = source.report(UNIX)
    assert data is not None
    report = RtcpPacket.parse(data)[0]
    assert isinstance(report, RtcpSrPacket)
    middle = report.sender_info.ntp_timestamp >> 16 & 0xFFFFFFFF
    source.reported(fraction_lost=64, packets_lost=9, jitter=900, last_report=middle, delay=32768, now=UNIX + 0.6)
    assert source.stats.fraction_lost == 0.25
    assert source.stats.packets_lost == 9
    assert source.stats.jitter_ms == 10.0
    assert source.stats.round_trip_ms == pytest.approx(100.0, abs=0.1)


def test_a_receiver_report_that_answers_no_report_of_ours_gives_no_round_trip_time() -> None:
    source = stream()
    source.reported(fraction_lost=0, packets_lost=0, jitter=0, last_report=5, delay=0, now=UNIX)
    assert source.stats.round_trip_ms is None
