import pytest
from aiortc.rtp import RtcpPacket, RtcpReceiverInfo, RtcpRrPacket
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.client.media.receiver_reports import ReceiverReports
from lockstep.client.media.rtp_header import RtpHeader

VIDEO, SOUND = 1111, 2222


def header(sequence: int, timestamp: int = 0, ssrc: int = VIDEO) -> RtpHeader:
    return RtpHeader(96, True, sequence % 65536, timestamp, ssrc, 0, b"")


def watching(*sources: int) -> ReceiverReports:
    reports = ReceiverReports(77)
    for source in sources or (VIDEO,):
        reports.add(source, 90_000)
    return reports


def blocks(reports: ReceiverReports, now: float = 1.0) -> list[RtcpReceiverInfo]:
    data = reports.report(now)
    assert data is not None
    (packet,) = RtcpPacket.parse(data)
    assert isinstance(packet, RtcpRrPacket)
    assert packet.ssrc == 77
    return packet.reports


def test_nothing_is_reported_before_the_first_packet() -> None:
    assert watching().report(0.0) is None


@pytest.mark.parametrize("start", [0, 100, 65_530])
def test_lost_packets_are_counted_across_the_wrap(start: int) -> None:
    reports = watching()
    for i in range(20):
        if i % 4 != 1:
            reports.packet(header(start + i), i / 50)
    (block,) = blocks(reports)
    assert (block.packets_lost, block.fraction_lost) == (5, 64)
    assert block.highest_sequence == start + 19


def test_the_fraction_is_that_since_the_last_report() -> None:
    reports = watching()
    for i in (0, 1, 4, 5):
        reports.packet(header(i), 0.0)
    assert blocks(reports)[0].fraction_lost == 85
    for i in range(6, 10):
        reports.packet(header(i), 0.0)
    (block,) = blocks(reports)
    assert (block.fraction_lost, block.packets_lost) == (0, 2)


def test_a_late_packet_is_no_longer_lost() -> None:
    reports = watching()
    for i in (0, 2, 1):
        reports.packet(header(i), 0.0)
    assert blocks(reports)[0].packets_lost == 0


def test_the_last_sender_report_is_named_with_its_age() -> None:
    reports = watching()
    reports.packet(header(0), 0.0)
    sender_report = bytes((0x80, 200, 0, 6)) + VIDEO.to_bytes(4, "big") + bytes((0, 0, 1, 2, 3, 4, 0, 0)) + bytes(12)
    reports.control(sender_report, 2.0)
    (block,) = blocks(reports, 2.5)
    assert (block.lsr, block.dlsr) == (0x01020304, 32768)


def test_jitter_is_that_of_frames() -> None:
    reports = watching()
    for i in range(200):
        reports.packet(header(i, i * 3000), i / 30 + (0.01 if i % 2 else 0.0))
    assert blocks(reports)[0].jitter == pytest.approx(900, rel=0.1)


def test_every_stream_has_a_block_and_strangers_have_none() -> None:
    reports = watching(VIDEO, SOUND)
    for ssrc in (VIDEO, SOUND, 5):
        reports.packet(header(1, ssrc=ssrc), 0.0)
    assert [block.ssrc for block in blocks(reports)] == [VIDEO, SOUND]


@settings(deadline=None)
@given(st.binary(max_size=60))
def test_no_control_packet_breaks_it(data: bytes) -> None:
    watching().control(data, 0.0)
