from itertools import count

import pytest
from aiortc.codecs import depayload
from aiortc.rtcrtpparameters import RTCRtpCodecParameters
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.carriers import split_trailer
from lockstep.server.media.codecs.packetise import (
    PAYLOAD_MAX,
    packetise_h264,
    packetise_sound,
    packetise_vp8,
    split_nal_units,
)
from lockstep.server.media.pipeline.frame import frame_trailer

H264 = RTCRtpCodecParameters(mimeType="video/H264", clockRate=90000)
VP8 = RTCRtpCodecParameters(mimeType="video/VP8", clockRate=90000)
START = b"\x00\x00\x00\x01"
SIZES = st.lists(st.one_of(st.integers(1, 40), st.integers(PAYLOAD_MAX - 4, PAYLOAD_MAX + 4), st.integers(1, 9000)))


def nal(size: int, kind: int = 1) -> bytes:
    """A unit of `size` bytes after its header, without anything that looks like a start code."""
    return bytes([0x60 | kind]) + bytes(1 + i % 255 for i in range(size))


@given(SIZES, st.sampled_from([b"", b"a trailer of any length"]))
def test_h264_units_of_any_size_arrive_whole_with_the_trailer_behind_the_last(sizes: list[int], trailer: bytes) -> None:
    stream = b"".join(START + nal(size) for size in sizes)
    payloads = packetise_h264(stream, trailer)
    assert all(len(payload) <= PAYLOAD_MAX for payload in payloads)
    received = b"".join(depayload(H264, payload) for payload in payloads)
    assert received == (stream + trailer if sizes else b"")


def test_fragments_are_marked_as_first_and_last_once() -> None:
    payloads = packetise_h264(START + nal(5000, kind=5))
    assert [payload[1] >> 6 for payload in payloads] == [0b10, *[0] * (len(payloads) - 2), 0b01]
    assert all(payload[0] & 0x1F == 28 and payload[1] & 0x1F == 5 for payload in payloads)


def test_parameter_sets_share_a_packet() -> None:
    payloads = packetise_h264(START + nal(10, 7) + START + nal(4, 8) + START + nal(3000, 5))
    assert payloads[0][0] & 0x1F == 24
    assert payloads[0][3] & 0x1F == 7


def test_supplemental_information_and_delimiters_are_left_out() -> None:
    stream = START + nal(2, 9) + START + nal(600, 6) + START + nal(100, 1)
    assert packetise_h264(stream) == [nal(100, 1)]


@pytest.mark.parametrize("start", [b"\x00\x00\x01", b"\x00\x00\x00\x01", b"\x00\x00\x00\x00\x00\x01"])
def test_start_codes_of_any_length_are_understood(start: bytes) -> None:
    assert list(split_nal_units(start + nal(5) + start + nal(7))) == [nal(5), nal(7)]


def test_what_is_no_byte_stream_gives_no_payload() -> None:
    assert packetise_h264(b"") == packetise_h264(b"\x01\x02") == packetise_h264(START) == []


@given(st.binary(max_size=9000), st.sampled_from([b"", b"trailer"]))
def test_vp8_frames_of_any_size_arrive_whole(frame: bytes, trailer: bytes) -> None:
    payloads = packetise_vp8(frame, trailer)
    assert all(len(payload) <= PAYLOAD_MAX for payload in payloads)
    assert b"".join(depayload(VP8, payload) for payload in payloads) == frame + trailer
    assert [payload[0] & 0x10 for payload in payloads] == [0x10 if i == 0 else 0 for i in range(len(payloads))]
    assert all(payload[0] & 0x80 == 0 for payload in payloads)  # no picture id: see packetise_vp8


def test_a_sound_packet_is_one_payload() -> None:
    assert packetise_sound(b"opus", b"trailer") == [b"opustrailer"]


@given(st.integers(1, 2**31 - 1), st.floats(0, 4e9))
def test_a_trailer_is_read_back(stamp: int, capture_time: float) -> None:
    rest, trailer = split_trailer(b"frame" + frame_trailer(stamp, capture_time))
    assert (rest, trailer and trailer.event) == (b"frame", stamp)


@pytest.mark.parametrize("shift", [0, 8, 16])
@pytest.mark.parametrize("low", [0xFFFFFC, 0xFFFFFD, 0xFFFFFE, 0xFFFFFF])
def test_a_capture_time_never_looks_like_a_start_code(shift: int, low: int) -> None:
    base = 1_790_000_000_000_000 & ~0xFF_FFFF_FFFF
    for capture_time_us in (base | low << shift | (1 << shift) - 1, base | low << shift):
        trailer = frame_trailer(7, capture_time_us / 1_000_000)
        for i in range(len(trailer) - 2):
            assert not (trailer[i] == trailer[i + 1] == 0 and trailer[i + 2] <= 3)
        read = split_trailer(trailer)[1]
        assert read is not None
        assert read.capture_time_us is not None
        assert 0 <= capture_time_us - read.capture_time_us < 4 << 8 * (shift // 8 + 1)


def test_an_ordinary_capture_time_is_exact() -> None:
    for i in count(1_790_000_000_000_000, 999_983):
        if i > 1_790_000_100_000_000:
            break
        trailer = split_trailer(frame_trailer(7, i / 1_000_000))[1]
        assert trailer is not None
        assert trailer.capture_time_us == int(i / 1_000_000 * 1_000_000)
