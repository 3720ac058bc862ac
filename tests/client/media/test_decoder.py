from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.client.media.decoder import Decoder, is_h264_keyframe, is_vp8_keyframe
from lockstep.client.media.frame_assembler import EncodedFrame
from tests.client.pictures import encode


@pytest.mark.parametrize("codec", ["VP8", "H264"])
def test_each_picture_comes_out_at_once_with_its_own_stamp(codec: str) -> None:
    decoder = Decoder(codec)
    for number, data in enumerate(encode(codec, 12)):
        [decoded] = decoder.decode(EncodedFrame(3000 * number, data, 100 + number))
        assert (decoded.stamp, decoded.timestamp) == (100 + number, 3000 * number)
        assert isinstance(decoded.frame, av.VideoFrame)
        luma = decoded.frame.to_ndarray()[:48].mean()
        assert luma == pytest.approx(16 + 8 * number, abs=4)


@pytest.mark.parametrize(("codec", "check"), [("VP8", is_vp8_keyframe), ("H264", is_h264_keyframe)])
def test_keyframes_are_told_from_the_others(codec: str, check: Any) -> None:
    assert [check(data) for data in encode(codec, 7, every=3)] == [True, False, False, True, False, False, True]


@pytest.mark.parametrize("codec", ["VP8", "H264"])
def test_what_is_no_frame_raises_the_documented_error_or_gives_nothing(codec: str) -> None:
    decoder = Decoder(codec)
    for data in (b"\x00", b"\xff" * 50, bytes(100)):
        try:
            assert decoder.decode(EncodedFrame(0, data, 1)) == []
        except av.FFmpegError:
            continue


def test_sound_keeps_its_stamp() -> None:
    context: Any = av.CodecContext.create("libopus", "w")
    context.sample_rate, context.format, context.layout = 48000, "s16", "stereo"
    decoder = Decoder("opus")
    stamps = []
    for number in range(5):
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1920), np.int16), format="s16", layout="stereo")
        frame.sample_rate, frame.pts = 48000, number * 960
        for packet in context.encode(frame):
            stamps += [decoded.stamp for decoded in decoder.decode(EncodedFrame(0, bytes(packet), number))]
    assert stamps == [0, 1, 2, 3, 4]


def test_g711_is_decoded() -> None:
    [decoded] = Decoder("PCMU").decode(EncodedFrame(160, b"\xff" * 160, 9))
    assert isinstance(decoded.frame, av.AudioFrame)
    assert (decoded.stamp, decoded.frame.samples, decoded.frame.sample_rate) == (9, 160, 8000)


def test_an_unknown_codec_has_no_decoder() -> None:
    with pytest.raises(KeyError):
        Decoder("AV2")


@settings(deadline=None)
@given(st.binary(max_size=200))
def test_no_bytes_upset_the_keyframe_checks(data: bytes) -> None:
    assert is_h264_keyframe(data) in (True, False)
    assert is_vp8_keyframe(data) in (True, False)
