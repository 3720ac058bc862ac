"""Pictures of a camera, encoded and decoded again."""

from collections.abc import Callable
from typing import Any

import av
import numpy as np
import pytest

from lockstep.protocol.messages import Media, MediaCodec
from lockstep.robot_bridge.encoding.encoding_requests import EncodingGoal
from lockstep.robot_bridge.encoding.picture_encoder import MOST_WRONG, H264Encoder
from lockstep.robot_bridge.errors import EncodingFailed
from lockstep.robot_bridge.robots.event_strip import read_event_strip, with_event_strip
from lockstep.server.media.codecs.h264 import inspect

WHOLE = EncodingGoal(500_000, 0.0, 1.0)


def raw(number: int, width: int = 320, height: int = 240, codec: MediaCodec = "yuv420p") -> Media:
    """A moving block on noise, which is not cheap to encode."""
    draw = np.random.default_rng(number)
    luma = draw.integers(90, 110, (height, width), np.uint8)
    luma[:40, 10 * number % (width - 40) :][:, :40] = 230
    chroma = bytes([128]) * (2 * ((width + 1) // 2) * ((height + 1) // 2))
    return Media(
        stream="front",
        codec=codec,
        stamp=number + 1,
        time=number / 30,
        payload=luma.tobytes() + chroma,
        width=width,
        height=height,
    )


def decoded(units: list[bytes]) -> list[av.VideoFrame]:
    context = av.CodecContext.create("h264", "r")
    context.thread_count = 1
    assert isinstance(context, av.VideoCodecContext)
    context.flags |= av.codec.context.Flags.low_delay
    return [frame for unit in units for frame in context.decode(av.Packet(unit))]


def test_each_picture_is_one_access_unit_that_decodes_at_once() -> None:
    encoder = H264Encoder()
    pictures = [encoder.encode(raw(n), WHOLE, keyframe=n in (0, 7)) for n in range(10)]
    assert [each.keyframe for each in pictures] == [n in (0, 7) for n in range(10)]
    frames = decoded([each.data for each in pictures])
    assert [(frame.width, frame.height) for frame in frames] == [(320, 240)] * 10
    for number, frame in enumerate(frames):
        assert frame.to_ndarray()[20, 10 * number + 20] > 180  # the block is where it was drawn
    found = inspect(pictures[7].data)
    assert found.keyframe
    assert found.profile is not None
    assert found.profile.constrained


@pytest.mark.parametrize(("width", "height"), [(323, 241), (64, 48), (330, 250)])
def test_sizes_whose_rows_are_padded_or_odd_come_out_right(width: int, height: int) -> None:
    (frame,) = decoded([H264Encoder().encode(raw(0, width, height), WHOLE, keyframe=True).data])
    assert (frame.width, frame.height) == (width - width % 2, height - height % 2)
    luma = frame.to_ndarray()
    assert luma[20, 20] > 180
    assert abs(float(luma[height - 4, : frame.width].mean()) - 100) < 20


@pytest.mark.parametrize(("width", "height"), [(320, 240), (640, 480)])
def test_a_keyframe_of_a_second_encoding_takes_no_more_than_the_time_to_the_next_picture(
    width: int, height: int
) -> None:
    encoder, goal = H264Encoder(frame_rate=30.0, keyframe_seconds=1 / 30), EncodingGoal(600_000, 0.0, 1.0)
    pictures = [encoder.encode(raw(n, width, height), goal, keyframe=n in (0, 20, 30)) for n in range(40)]
    assert [n for n, each in enumerate(pictures) if each.keyframe] == [0, 20, 30]
    most = 1.3 / 30 * goal.bitrate  # the encoder's highest rate is 1.3 times what is asked for
    assert [n for n, each in enumerate(pictures) if 8 * len(each.data) > most] == []


def test_a_keyframe_of_a_starved_path_still_shows_the_picture() -> None:
    """Beyond the quantisers of H.264, x264 leaves nothing of it but grey."""
    encoder = H264Encoder()
    starved = EncodingGoal(30_000, 0.0, 1.0)
    media = [with_event_strip(raw(number, 240, 180)) for number in range(40)]
    pictures = [encoder.encode(each, starved, keyframe=number % 10 == 0) for number, each in enumerate(media)]
    shown = [read_event_strip(frame.to_ndarray(format="gray")) for frame in decoded([each.data for each in pictures])]
    assert shown[::10] == [1, 11, 21, 31]


def test_a_smaller_size_begins_with_a_keyframe() -> None:
    encoder = H264Encoder()
    encoder.encode(raw(0), WHOLE, keyframe=False)
    encoder.encode(raw(1), WHOLE, keyframe=False)
    small = encoder.encode(raw(2), EncodingGoal(500_000, 0.0, 0.5), keyframe=False)
    assert (small.keyframe, small.width, small.height) == (True, 160, 120)


def test_the_bitrate_follows_what_is_asked_for_without_a_keyframe() -> None:
    encoder, sizes = H264Encoder(), []
    for begin, bitrate in ((0, 600_000), (120, 300_000)):
        goal = EncodingGoal(bitrate, 0.0, 1.0)
        pictures = [encoder.encode(raw(n), goal, keyframe=False) for n in range(begin, begin + 120)]
        sizes.append(8 * sum(len(each.data) for each in pictures[30:]) / 3)
    assert not any(each.keyframe for each in pictures)
    assert sizes[0] < 600_000 * 1.4
    assert sizes[1] < 300_000 * 1.4


def test_jpeg_pictures_are_encoded_too() -> None:
    context = av.CodecContext.create("mjpeg", "w")
    assert isinstance(context, av.VideoCodecContext)
    context.width, context.height, context.pix_fmt, context.framerate = 160, 120, "yuvj420p", 30  # type: ignore[assignment]
    (jpeg,) = context.encode(av.VideoFrame.from_ndarray(np.full((180, 160), 128, np.uint8), "yuvj420p"))
    medium = Media(stream="front", codec="mjpeg", stamp=1, time=0.0, payload=bytes(jpeg))
    encoded = H264Encoder().encode(medium, WHOLE, keyframe=True)
    assert (encoded.width, encoded.height, encoded.keyframe) == (160, 120, True)


@pytest.mark.parametrize(
    "medium",
    [
        Media(stream="front", codec="yuv420p", stamp=1, time=0.0, payload=b"short", width=320, height=240),
        Media(stream="front", codec="yuv420p", stamp=1, time=0.0, payload=b""),
        Media(stream="front", codec="mjpeg", stamp=1, time=0.0, payload=b"not a picture"),
        Media(stream="front", codec="h264", stamp=1, time=0.0, payload=b""),
    ],
)
def test_what_is_no_picture_is_named_and_the_next_begins_afresh(medium: Media) -> None:
    encoder = H264Encoder()
    with pytest.raises(EncodingFailed):
        encoder.encode(medium, WHOLE, keyframe=False)
    assert encoder.encode(raw(1), WHOLE, keyframe=False).keyframe


def fallback(caplog: pytest.LogCaptureFixture) -> str:
    """Why the software encoder has taken the other's place, as the log says; "" while it has not."""
    said = [each.getMessage().partition("encoder_fallback: ") for each in caplog.records]
    return "".join(why for _, found, why in said if found)


@pytest.mark.parametrize("name", ["h264_v4l2m2m", "h264_nvenc", "h264_qsv"])
def test_ffmpeg_takes_the_options_of_each_hardware_encoder_even_where_its_device_is_missing(
    name: str, caplog: pytest.LogCaptureFixture
) -> None:
    encoder = H264Encoder(name)
    level = av.logging.get_level()
    av.logging.set_level(av.logging.ERROR)
    try:
        with av.logging.Capture() as lines:
            assert encoder.encode(raw(0), WHOLE, keyframe=False).keyframe
    finally:
        av.logging.set_level(level)
    said = "".join(text for _, source, text in lines if source == name)
    assert said or not fallback(caplog)
    assert "option" not in said
    assert "pixel format" not in said


def stand_in(monkeypatch: pytest.MonkeyPatch, open_one: Callable[..., Any]) -> H264Encoder:
    """Return an encoder that takes libx264, as `open_one` opens it, for h264_nvenc: no hardware can be had here."""
    open_as = H264Encoder._open_as

    def open_instead(self: H264Encoder, name: str, size: tuple[int, int], bitrate: int, rate: float, own: Any) -> Any:
        if name != "h264_nvenc":
            return open_as(self, name, size, bitrate, rate, own)
        self._context = open_one(lambda options: open_as(self, "libx264", size, bitrate, rate, options))
        return self._context

    monkeypatch.setattr(H264Encoder, "_open_as", open_instead)
    return H264Encoder("h264_nvenc")


@pytest.mark.parametrize("preset", ["", "none such"])
def test_the_software_encoder_takes_the_place_of_one_that_is_missing_or_cannot_be_opened(
    preset: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    if preset:
        name, encoder = "h264_nvenc", stand_in(monkeypatch, lambda opened: opened({"preset": preset}))
    else:
        name, encoder = "h264_missing", H264Encoder("h264_missing")
    assert encoder.encode(raw(0), WHOLE, keyframe=False).keyframe
    assert fallback(caplog).startswith(f"{name} cannot be opened")
    assert not encoder.encode(raw(1), WHOLE, keyframe=False).keyframe


def test_an_encoder_that_delays_gives_no_older_picture_and_the_software_encoder_takes_its_place(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """libx264 without `zerolatency` stands in for hardware that delays: it looks ahead."""
    encoder = stand_in(monkeypatch, lambda opened: opened({"preset": "ultrafast", "rc-lookahead": "2"}))
    for number in range(MOST_WRONG):
        assert not fallback(caplog)
        with pytest.raises(EncodingFailed, match="held the picture back"):
            encoder.encode(raw(number), WHOLE, keyframe=False)
    assert fallback(caplog).startswith("h264_nvenc cannot be used: it held the picture back")
    pictures = [encoder.encode(raw(n), WHOLE, keyframe=False) for n in range(MOST_WRONG, 10)]
    assert [each.keyframe for each in pictures] == [True] + [False] * (9 - MOST_WRONG)
    for number, frame in enumerate(decoded([each.data for each in pictures]), MOST_WRONG):
        assert frame.to_ndarray()[20, 10 * number + 20] > 180  # the block is where it was drawn


class Miscounting:
    """An encoder that gives its second picture under the time of the first."""

    def __init__(self, context: Any) -> None:
        self._context = context
        self._times: list[int] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def encode(self, frame: av.VideoFrame) -> list[Any]:
        (packet,) = self._context.encode(frame)
        self._times.append(packet.pts)
        if len(self._times) == 2:
            packet.pts = self._times[0]
        return [packet]


def test_after_a_packet_of_another_picture_the_encoder_is_opened_again_and_begins_with_a_keyframe(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """libx264 whose packet is given the wrong time stands in for such hardware."""
    encoder = stand_in(monkeypatch, lambda opened: Miscounting(opened({"tune": "zerolatency"})))
    for first in range(0, 2 * MOST_WRONG, 2):
        assert encoder.encode(raw(first), WHOLE, keyframe=False).keyframe
        with pytest.raises(EncodingFailed, match="another picture"):
            encoder.encode(raw(first + 1), WHOLE, keyframe=False)
    assert not fallback(caplog)  # never several in a row
