"""What is in RTP payloads; `tests/client/media/test_payloads.py` compares with aiortc's reader."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.rtp.wire.payloads import H264Part, PayloadError, Vp8Part, h264_parts, vp8_part


@pytest.mark.parametrize(
    ("payload", "begins"),
    [(b"\x10data", True), (b"\x00data", False), (b"\x11data", False), (b"\x90\xe0\x85\x05\x07\x40data", True)],
    ids=["first", "later", "second partition", "with all that a descriptor may have"],
)
def test_a_vp8_payload_says_whether_a_frame_begins(payload: bytes, begins: bool) -> None:
    assert vp8_part(payload) == Vp8Part(b"data", begins)


def test_an_h264_payload_is_one_unit_or_several_or_a_part_of_one() -> None:
    assert list(h264_parts(b"\x65whole")) == [H264Part(b"\x65whole", begins_unit=True)]
    aggregated = [H264Part(b"\x67ab", begins_unit=True), H264Part(b"\x68c", begins_unit=True)]
    assert list(h264_parts(b"\x78\x00\x03\x67ab\x00\x02\x68c")) == aggregated
    assert list(h264_parts(b"\x7c\x85begin")) == [H264Part(b"\x65begin", begins_unit=True)]
    assert list(h264_parts(b"\x7c\x45end")) == [H264Part(b"end", begins_unit=False)]


@given(st.binary(max_size=60))
def test_any_bytes_are_read_or_refused_by_name(payload: bytes) -> None:
    with suppress(PayloadError):
        vp8_part(payload)
    with suppress(PayloadError):
        assert sum(len(part.data) for part in h264_parts(payload)) <= len(payload)
