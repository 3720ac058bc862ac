import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.errors import FramingError
from lockstep.protocol.framing import LARGE_FRAME, FrameReader, frame


def read_all(reader: FrameReader, data: bytes, size: int) -> list[bytes | bytearray]:
    frames: list[bytes | bytearray] = []
    for start in range(0, len(data), size):
        reader.feed(data[start : start + size])
        frames += list(reader.frames())
    return frames


def test_a_frame_is_its_length_in_4_big_endian_bytes_and_then_its_bytes() -> None:
    assert frame(b"abc") == b"\x00\x00\x00\x03abc"


@given(st.lists(st.binary(min_size=1, max_size=50), max_size=8), st.integers(1, 64))
def test_frames_come_out_as_they_went_in_however_the_stream_is_cut(payloads: list[bytes], size: int) -> None:
    reader = FrameReader(50)
    assert read_all(reader, b"".join(map(frame, payloads)), size) == payloads
    reader.at_end()


@pytest.mark.parametrize("size", [1 << 20, LARGE_FRAME, LARGE_FRAME + 3, LARGE_FRAME + 4, 40_000, 1009, 7])
def test_pictures_come_out_as_they_went_in_among_small_frames(size: int) -> None:
    picture = bytes(range(256)) * (LARGE_FRAME // 256)
    payloads = [b"small", picture, picture + b"and more", b"another", b"third", picture[:-1]]
    reader = FrameReader(2 * LARGE_FRAME)
    assert read_all(reader, b"".join(map(frame, payloads)), size) == payloads
    reader.at_end()


def test_the_end_inside_a_picture_is_an_error() -> None:
    reader = FrameReader(LARGE_FRAME)
    reader.feed(frame(bytes(LARGE_FRAME))[:1000])
    assert list(reader.frames()) == []
    reader.feed(bytes(500))
    assert list(reader.frames()) == []
    with pytest.raises(FramingError, match="1500 bytes into a frame"):
        reader.at_end()


@pytest.mark.parametrize("length", [0, 11, 2**32 - 1])
def test_a_length_out_of_bounds_is_refused_before_its_bytes_arrive(length: int) -> None:
    reader = FrameReader(10)
    reader.feed(length.to_bytes(4, "big"))
    with pytest.raises(FramingError, match="1 to 10"):
        list(reader.frames())


def test_frames_before_a_bad_length_are_still_delivered() -> None:
    reader = FrameReader(10)
    reader.feed(frame(b"good") + b"\xff\xff\xff\xff")
    frames = reader.frames()
    assert next(frames) == b"good"
    with pytest.raises(FramingError):
        next(frames)


def test_the_end_inside_a_frame_is_an_error() -> None:
    reader = FrameReader(10)
    reader.feed(frame(b"abc")[:-1])
    assert list(reader.frames()) == []
    with pytest.raises(FramingError, match="6 bytes into a frame"):
        reader.at_end()


def test_stopping_in_the_middle_of_the_frames_loses_none() -> None:
    reader = FrameReader(10)
    reader.feed(frame(b"one") + frame(b"two"))
    frames = reader.frames()
    assert next(frames) == b"one"
    del frames
    assert list(reader.frames()) == [b"two"]


@given(st.binary(max_size=200))
def test_any_bytes_give_frames_or_a_framing_error(data: bytes) -> None:
    reader = FrameReader(20)
    reader.feed(data)
    with contextlib.suppress(FramingError):
        assert all(0 < len(payload) <= 20 for payload in reader.frames())


@given(st.lists(st.binary(min_size=1, max_size=50), max_size=4), st.integers(1, 64))
def test_it_says_whether_a_frame_is_there(payloads: list[bytes], size: int) -> None:
    data = b"".join(map(frame, payloads))
    reader = FrameReader(50)
    for start in range(0, len(data), size):
        reader.feed(data[start : start + size])
        while reader.has_frame:
            with contextlib.closing(reader.frames()) as frames:
                assert next(frames) == payloads.pop(0)
        assert list(reader.frames()) == []
    assert payloads == []


def test_a_large_frame_is_there_when_it_is_whole_and_a_bad_length_at_once() -> None:
    reader = FrameReader(LARGE_FRAME)
    data = frame(bytes(LARGE_FRAME))
    for part in (data[:10], data[10:-1]):
        reader.feed(part)
        assert list(reader.frames()) == []
        assert not reader.has_frame
    reader.feed(data[-1:])
    assert reader.has_frame
    assert list(reader.frames()) == [bytes(LARGE_FRAME)]
    reader.feed(b"\xff\xff\xff\xff")
    assert reader.has_frame
    with pytest.raises(FramingError):
        next(reader.frames())
