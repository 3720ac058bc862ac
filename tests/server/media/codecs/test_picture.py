"""Colours from the robot link to the decoded picture, in sizes that cameras really have."""

from fractions import Fraction
from typing import Any

import av
import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.picture import PictureDecoder
from lockstep.server.media.codecs.picture_encoder import VIDEO_CODECS, create_picture_encoder
from lockstep.server.media.errors import PayloadError
from tests.server.media.camera_h264 import camera_pictures

SIZES = [(250, 250), (480, 270), (440, 330), (1920, 1078), (320, 240), (251, 250), (250, 251), (333, 251)]
DECODERS = {"H264": "h264", "VP8": "libvpx"}
QUARTERS = [(60, 90, 170), (120, 160, 90), (180, 100, 120), (210, 140, 140)]  # Y, U, V: top left, right, bottom …

Pixels = npt.NDArray[np.uint8]


def quartered(width: int, height: int, values: tuple[int, int, int, int]) -> Pixels:
    """Each quarter of the plane has a value of its own."""
    plane = np.empty((height, width), np.uint8)
    top, left = (height + 1) // 2, (width + 1) // 2
    plane[:top, :left], plane[:top, left:], plane[top:, :left], plane[top:, left:] = values
    return plane


def raw(width: int, height: int) -> Media:
    luma, u, v = zip(*QUARTERS, strict=True)
    half = ((width + 1) // 2, (height + 1) // 2)
    payload = b"".join(
        plane.tobytes() for plane in (quartered(width, height, luma), quartered(*half, u), quartered(*half, v))
    )
    return Media(stream="camera", codec="yuv420p", stamp=1, time=0.0, payload=payload, width=width, height=height)


def jpeg(width: int, height: int) -> Media:
    context: Any = av.CodecContext.create("mjpeg", "w")
    context.width, context.height, context.pix_fmt, context.time_base = width, height, "yuvj420p", Fraction(1, 30)
    frame = av.VideoFrame(width, height, "yuvj420p")
    for plane, values in zip(frame.planes, zip(*QUARTERS, strict=True), strict=True):
        rows = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size)
        rows[: plane.height, : plane.width] = quartered(plane.width, plane.height, values)
    frame.pts = 0
    payload = b"".join(map(bytes, [*context.encode(frame), *context.encode(None)]))
    return Media(stream="camera", codec="mjpeg", stamp=1, time=0.0, payload=payload, width=width, height=height)


def corners(frame: av.VideoFrame) -> list[list[tuple[int, int, int]]]:
    """Y, U and V near and at the outer edge of each quarter."""
    planes = [np.frombuffer(memoryview(plane), np.uint8).reshape(-1, plane.line_size) for plane in frame.planes]

    def at(row: int, column: int) -> tuple[int, int, int]:
        luma, u, v = planes
        return int(luma[row, column]), int(u[row // 2, column // 2]), int(v[row // 2, column // 2])

    high, wide = frame.height, frame.width
    return [
        [at(0, 0), at(high // 4, wide // 4)],
        [at(0, wide - 1), at(high // 4, wide * 3 // 4)],
        [at(high - 1, 0), at(high * 3 // 4, wide // 4)],
        [at(high - 1, wide - 1), at(high * 3 // 4, wide * 3 // 4)],
    ]


@pytest.mark.parametrize("codec", VIDEO_CODECS)
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_each_corner_keeps_its_colour_from_the_link_to_the_decoded_picture(width: int, height: int, codec: str) -> None:
    encoded = create_picture_encoder(codec, 4_000_000, 30.0).encode(
        PictureDecoder().decode(raw(width, height)), 0, True
    )
    decoder: Any = av.CodecContext.create(DECODERS[codec], "r")
    frame = next(iter([*decoder.decode(av.Packet(encoded.data)), *decoder.decode(None)]))
    assert (frame.width, frame.height) == (width - width % 2, height - height % 2)
    for shown, meant in zip(corners(frame), QUARTERS, strict=True):
        assert np.abs(np.array(shown) - meant).max() <= 8


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_a_jpeg_of_any_size_loses_at_most_its_last_row_and_column(width: int, height: int) -> None:
    frame = PictureDecoder().decode(jpeg(width, height))
    assert (frame.width, frame.height) == (width - width % 2, height - height % 2)
    full = [
        (round(16 + y * 219 / 255), round(128 + (u - 128) * 224 / 255), round(128 + (v - 128) * 224 / 255))
        for y, u, v in QUARTERS
    ]
    for shown, meant in zip(corners(frame), full, strict=True):
        assert np.abs(np.array(shown) - meant).max() <= 8


@pytest.mark.parametrize(("width", "height"), [(14, 240), (320, 15), (0, 0)])
def test_a_picture_that_is_too_small_is_refused(width: int, height: int) -> None:
    with pytest.raises(PayloadError, match="at least 16 pixels"):
        PictureDecoder().decode(raw(max(width, 1), max(height, 1)))


@pytest.mark.parametrize("more", [-1, 1])
def test_a_payload_of_another_length_than_its_size_says_is_refused(more: int) -> None:
    whole = raw(251, 251)
    payload = whole.payload + b"x" if more > 0 else whole.payload[:more]
    with pytest.raises(PayloadError, match="not a yuv420p picture of 251x251"):
        PictureDecoder().decode(
            Media(**{**{f: getattr(whole, f) for f in whole.__struct_fields__}, "payload": payload})
        )


def test_a_picture_that_says_it_is_huge_is_refused_before_there_is_memory_for_it() -> None:
    small = jpeg(64, 64).payload
    size = small.index(b"\xff\xc0") + 5  # in the frame header (ITU-T T.81 B.2.2)
    side = 16_000
    huge = small[:size] + side.to_bytes(2, "big") * 2 + small[size + 4 : -2] + bytes(side * side // 250) + small[-2:]
    decoder = PictureDecoder()
    with pytest.raises(PayloadError):
        decoder.decode(Media(stream="camera", codec="mjpeg", stamp=1, time=0.0, payload=huge, width=64, height=64))
    assert decoder.decode(jpeg(64, 64)).width == 64, "and the next one is decoded"


def test_what_builds_on_a_picture_that_was_not_decoded_is_refused_until_a_keyframe() -> None:
    """FFmpeg would draw it over grey, or over a picture that it does not build on."""
    key, first, second, third = camera_pictures(4)
    decoder = PictureDecoder()
    with pytest.raises(PayloadError):
        decoder.decode(first, (first,))
    assert decoder.decode(key, (key,)).width > 0
    broken = msgspec.structs.replace(first, payload=b"\x00\x00\x00\x01\x65key")
    with pytest.raises(PayloadError):
        decoder.decode(second, (broken, second))
    with pytest.raises(PayloadError):
        decoder.decode(third, (third,))
    assert decoder.decode(first, (key, first)).width > 0


def test_a_message_or_parameter_sets_by_themselves_are_no_hole_between_pictures() -> None:
    key, first, second, _ = camera_pictures(4)
    aside = [
        msgspec.structs.replace(first, payload=b"\x00\x00\x00\x01" + unit)
        for unit in (b"\x06\x05\x01\x00\x80", b"\x09\x10", b"\x67\x42")
    ]
    decoder = PictureDecoder()
    assert decoder.decode(first, (aside[0], key, aside[1], first)).width > 0
    assert decoder.decode(second, (*aside[:2], second)).width > 0
    with pytest.raises(PayloadError):
        decoder.decode(aside[1], (aside[1],))
