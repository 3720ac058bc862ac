"""What is in RTP payloads, against aiortc's codecs, which have a reader of their own."""

from contextlib import suppress

import pytest
from aiortc.codecs import depayload
from aiortc.rtcrtpparameters import RTCRtpCodecParameters
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.media.payloads import UNPACK
from lockstep.rtc.rtp.wire.payloads import PayloadError

VP8 = RTCRtpCodecParameters(mimeType="video/VP8", clockRate=90_000, payloadType=96)
H264 = RTCRtpCodecParameters(mimeType="video/H264", clockRate=90_000, payloadType=98)
CASES = {
    "VP8": [
        b"\x10data",
        b"\x90\x80\x11data",  # PictureID of 7 bits
        b"\x90\x80\x91\x11data",  # of 15 bits
        b"\x90\xe0\x11\x22\x33data",  # with TL0PICIDX and TID
        b"\x80\x10\x33data",  # KEYIDX alone
    ],
    "H264": [
        b"\x65whole",
        b"\x78\x00\x03\x67ab\x00\x02\x68c",  # STAP-A
        b"\x7c\x85begin",  # FU-A
        b"\x7c\x05middle",
        b"\x7c\x45end",
    ],
}


@pytest.mark.parametrize(("codec", "payload"), [(codec, each) for codec, all_ in CASES.items() for each in all_])
def test_a_payload_is_unpacked_as_aiortc_does(codec: str, payload: bytes) -> None:
    assert UNPACK[codec](payload) == depayload(VP8 if codec == "VP8" else H264, payload)


@pytest.mark.parametrize(
    ("codec", "payload"),
    [
        ("VP8", b""),
        ("VP8", b"\x10"),
        ("VP8", b"\x90\x80\x91\x11"),
        ("H264", b"\x65"),
        ("H264", b"\x78\x00\x09\x67ab"),
        ("H264", b"\x78\x00\x00"),
        ("H264", b"\x7f\x00rest"),
    ],
)
def test_what_is_none_of_its_codec_is_said(codec: str, payload: bytes) -> None:
    with pytest.raises(PayloadError):
        UNPACK[codec](payload)


@given(st.sampled_from(sorted(UNPACK)), st.binary(max_size=40))
def test_no_payload_raises_anything_else(codec: str, payload: bytes) -> None:
    with suppress(PayloadError):
        UNPACK[codec](payload)


def test_sound_is_as_it_is() -> None:
    assert UNPACK["opus"](b"sound") == UNPACK["PCMU"](b"sound") == b"sound"
