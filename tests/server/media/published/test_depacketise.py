from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.rtp.wire.payloads import PayloadError
from lockstep.server.media.codecs.packetise import packetise_h264, packetise_vp8
from lockstep.server.media.published.depacketise import PictureCodec, begins_picture, is_keyframe, join_payloads

CODE = b"\x00\x00\x00\x01"
SPS, PPS, IDR, SLICE, DELIMITER = b"\x67abc", b"\x68d", b"\x65" + bytes(range(1, 200)) * 20, b"\x41efg", b"\x09\xf0"


@pytest.mark.parametrize("nals", [[SPS, PPS, IDR], [SLICE], [SLICE, b"\x41" + b"x" * 5000, SLICE]])
def test_what_was_packetised_comes_out_as_it_was(nals: list[bytes]) -> None:
    stream = b"".join(CODE + nal for nal in nals)
    assert join_payloads("H264", packetise_h264(stream)) == stream
    assert is_keyframe("H264", stream) == (nals[0] == SPS)


def test_a_single_nal_unit_may_be_a_packet_and_only_a_delimiter_or_parameter_set_certainly_begins_a_picture() -> None:
    assert join_payloads("H264", [SLICE]) == CODE + SLICE
    begins = {nal: begins_picture("H264", nal) for nal in (SPS, DELIMITER, PPS, IDR, SLICE)}
    assert begins == {SPS: True, DELIMITER: True, PPS: False, IDR: False, SLICE: False}
    assert not begins_picture("H264", packetise_h264(CODE + IDR)[1])


def test_an_intra_picture_without_its_parameter_sets_is_nothing_to_begin_with() -> None:
    assert not is_keyframe("H264", CODE + IDR)
    assert is_keyframe("H264", CODE + SPS + CODE + PPS + CODE + IDR)


@pytest.mark.parametrize(
    "descriptor", ["10", "90 80 05", "90 80 85 05", "90 c0 05 07", "90 e0 85 05 07 40", "90 10 01"]
)
def test_every_vp8_descriptor_is_cut_off(descriptor: str) -> None:
    payload = bytes.fromhex(descriptor) + b"\x00picture"
    assert join_payloads("VP8", [payload]) == b"\x00picture"
    assert begins_picture("VP8", payload)


def test_a_vp8_picture_of_several_packets_and_its_kind() -> None:
    for picture, keyframe in ((b"\x10" + b"k" * 4000, True), (b"\x11" + b"d" * 4000, False)):
        payloads = packetise_vp8(picture)
        assert len(payloads) > 3
        assert join_payloads("VP8", payloads) == picture
        assert is_keyframe("VP8", picture) == keyframe
        assert [begins_picture("VP8", each) for each in payloads[:2]] == [True, False]


@pytest.mark.parametrize(
    ("codec", "payloads"),
    [
        ("H264", [b"\x65"]),  # too short
        ("H264", [packetise_h264(CODE + IDR)[1]]),  # the middle of a fragmented unit
        ("H264", [b"\x78\x00\x09abc"]),  # an aggregate that is cut off
        ("H264", [b"\x78\x00\x00\x00\x01x"]),  # with an empty unit
        ("H264", [b"\x79abcd"]),  # STAP-B, of another packetization mode
        ("VP8", [b"\x00ab"]),  # no beginning
        ("VP8", [b"\x10ab", b"\x10ab"]),  # two of them
        ("VP8", [b"\x90\x80"]),  # nothing behind the descriptor
        ("VP8", [b"\x10"]),
        ("VP8", [b""]),
        ("VP8", [b"\x10ab", b""]),
    ],
)
def test_what_is_none_of_its_codec_is_refused(codec: PictureCodec, payloads: list[bytes]) -> None:
    with pytest.raises(PayloadError):
        join_payloads(codec, payloads)


@given(st.sampled_from(["H264", "VP8"]), st.lists(st.binary(max_size=40), min_size=1, max_size=5))
def test_any_bytes_make_a_picture_or_a_named_error(codec: Literal["H264", "VP8"], payloads: list[bytes]) -> None:
    begins_picture(codec, payloads[0])
    try:
        picture = join_payloads(codec, payloads)
    except PayloadError:
        return
    is_keyframe(codec, picture)
