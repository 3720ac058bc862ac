import struct

import pytest
from aiortc import rtp as aiortc_rtp
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.rtp.errors import RtpError
from lockstep.rtc.rtp.feedback import FullIntraRequest, Nack, PictureLoss, Remb, TransportFeedback
from lockstep.rtc.rtp.wire.rtcp import (
    Goodbye,
    ReceiverReport,
    ReportBlock,
    RtcpPacket,
    SenderReport,
    SourceDescription,
    UnknownRtcp,
    pack_rtcp,
    parse_rtcp,
)

u8, u16, u32, u64 = (st.integers(0, (1 << bits) - 1) for bits in (8, 16, 32, 64))
blocks = st.lists(
    st.builds(ReportBlock, u32, u8, st.integers(-(1 << 23), (1 << 23) - 1), u32, u32, u32, u32), max_size=31
).map(tuple)
ssrcs = st.lists(u32, max_size=31).map(tuple)
names = st.text(max_size=60).filter(lambda text: "\ud800" not in text)
packets = st.one_of(
    st.builds(SenderReport, u32, u64, u32, u32, u32, blocks),
    st.builds(ReceiverReport, u32, blocks),
    st.builds(SourceDescription, st.lists(st.tuples(u32, names), max_size=31).map(tuple)),
    st.builds(Goodbye, ssrcs),
    st.builds(PictureLoss, u32, u32),
    st.builds(FullIntraRequest, u32, st.lists(st.tuples(u32, u8), max_size=20).map(tuple)),
    st.builds(Remb, u32, st.integers(0, (1 << 18) - 1), ssrcs),
    st.builds(UnknownRtcp, st.just(204), st.integers(0, 31), st.integers(0, 20).map(lambda words: bytes(4 * words))),
)


@given(st.lists(packets, min_size=1, max_size=4))
def test_a_compound_packet_is_what_it_was_after_packing(compound: list[RtcpPacket]) -> None:
    assert parse_rtcp(pack_rtcp(compound)) == compound


@given(st.lists(u16, min_size=1, max_size=100, unique=True).map(sorted))
def test_a_nack_names_the_packets_that_it_was_made_of(lost: list[int]) -> None:
    [found] = parse_rtcp(Nack(1, 2, tuple(lost)).pack())
    assert isinstance(found, Nack)
    assert set(found.lost) == set(lost)
    assert len(found.lost) == len(lost)


def test_a_nack_over_the_wrap_needs_one_pair() -> None:
    packed = Nack(1, 2, (65535, 0, 1, 15)).pack()
    assert len(packed) == 16
    assert parse_rtcp(packed) == [Nack(1, 2, (65535, 0, 1, 15))]


@given(st.integers(0, 1 << 50))
def test_the_bitrate_of_an_estimate_is_right_to_eighteen_bits(bitrate: int) -> None:
    [found] = parse_rtcp(Remb(1, bitrate, (2,)).pack())
    assert isinstance(found, Remb)
    assert 0 <= bitrate - found.bitrate <= bitrate / (1 << 17)


@given(
    u16,
    st.lists(st.none() | st.integers(0, 4000), min_size=1, max_size=60),
    st.integers(0, 1 << 20),
)
def test_arrivals_are_right_to_a_quarter_of_a_millisecond(base: int, ticks: list[int | None], start: int) -> None:
    arrivals = tuple(None if each is None else (start * 256 + each) * 0.00025 for each in ticks)
    [found] = parse_rtcp(TransportFeedback(1, 2, 3, base, arrivals).pack())
    assert isinstance(found, TransportFeedback)
    assert (found.base, found.number) == (base, 3)
    assert [each is None for each in found.arrivals] == [each is None for each in arrivals]
    for sent, received in zip(arrivals, found.arrivals, strict=True):
        assert sent is None or (received is not None and abs(sent - received) < 0.0005)


def test_runs_and_one_bit_vectors_of_arrivals_are_read() -> None:
    # four packets: a run of two that came with small differences, then a vector "1, 0"
    control = struct.pack("!HHI", 100, 4, 5 << 8 | 9) + struct.pack("!HH", 1 << 13 | 2, 0b10 << 14 | 1 << 13)
    control += bytes((4, 8, 12))
    body = struct.pack("!II", 1, 2) + control + bytes(-len(control) % 4)
    [found] = parse_rtcp(UnknownRtcp(205, 15, body).pack())
    assert isinstance(found, TransportFeedback)
    times = [None if each is None else round(each, 5) for each in found.arrivals]
    assert times == [0.321, 0.323, 0.326, None]


@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_else(data: bytes) -> None:
    words = len(data) // 4
    for kind in (200, 201, 202, 203, 205, 206, 207):
        for count in (0, 1, 4, 15, 31):
            try:
                pack_rtcp(parse_rtcp(struct.pack("!BBH", 0x80 | count, kind, words) + data[: 4 * words]))
            except RtpError:
                continue


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x80\xc8\x00",
        b"\x00\xc8\x00\x00",
        b"\x80\xc8\x00\x01",
        b"\x80\xc8\x00\x00",
        b"\x81\xc9\x00\x01\x00\x00\x00\x01",
        b"\x81\xca\x00\x01\x00\x00\x00\x01",
        b"\x81\xcb\x00\x00",
        b"\x81\xcd\x00\x01\x00\x00\x00\x01",
        b"\xa0\xcc\x00\x00",
        b"\xa0\xcc\x00\x01\x00\x00\x00\x05",
        b"\xa0\xcc\x00\x01\x00\x00\x00\x04\x80\xcc\x00\x00",
        struct.pack("!BBHIIHHI", 0x8F, 205, 4, 1, 2, 0, 8193, 0),
        struct.pack("!BBHII", 0x81, 205, 2 + 100, 1, 2) + b"\x00\x00\xff\xff" * 100,
    ],
)
def test_what_is_cut_short_or_too_much_is_refused(data: bytes) -> None:
    with pytest.raises(RtpError):
        parse_rtcp(data)


def test_padding_is_taken_off_the_last_packet() -> None:
    data = PictureLoss(1, 2).pack()
    padded = struct.pack("!BBH", 0xA1, 206, 3) + data[4:] + b"\x00\x00\x00\x04"
    assert parse_rtcp(padded) == [PictureLoss(1, 2)]


def test_more_than_31_in_one_packet_is_an_error_of_the_caller() -> None:
    with pytest.raises(ValueError, match="31"):
        Goodbye(tuple(range(32))).pack()


def test_aiortc_reads_what_we_write_and_we_what_it_writes() -> None:
    ours: list[RtcpPacket] = [
        SenderReport(1, 2**40, 3, 4, 5, (ReportBlock(6, 7, -8, 9, 10, 11, 12),)),
        SourceDescription(((1, "name"),)),
        Nack(1, 2, (3, 4, 40)),
        PictureLoss(1, 2),
        Remb(1, 1_000_000, (2, 3)),
        Goodbye((1,)),
    ]
    theirs = aiortc_rtp.RtcpPacket.parse(pack_rtcp(ours))
    assert parse_rtcp(b"".join(bytes(each) for each in theirs)) == ours
    assert isinstance(theirs[4], aiortc_rtp.RtcpPsfbPacket)
    assert aiortc_rtp.unpack_remb_fci(theirs[4].fci) == (1_000_000, [2, 3])
