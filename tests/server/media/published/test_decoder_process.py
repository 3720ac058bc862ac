"""The process that decodes what a publisher sends."""

import io
import math

import av
import numpy as np
import pytest

from lockstep.server.media.codecs.picture_encoder import create_picture_encoder
from lockstep.server.media.published.decoder_process import MAX_RATE, PublishedPictures
from lockstep.server.media.published.depacketise import PictureCodec
from lockstep.server.media.published.encoded_wire import PICTURES, Encoded
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import Captured, Said, Trouble, Working
from tests.server.media.published.publishing import camera

CODECS: tuple[PictureCodec, ...] = ("H264", "VP8")


def grey(level: int, width: int = 160, height: int = 120) -> av.VideoFrame:
    planes = np.full((height * 3 // 2, width), 128, np.uint8)
    planes[:height] = level
    return av.VideoFrame.from_ndarray(planes, format="yuv420p")


def encoded(codec: PictureCodec, levels: list[int], width: int = 160, height: int = 120) -> list[Encoded]:
    encoder = create_picture_encoder(codec, 1_000_000, 30.0)
    found = []
    for number, level in enumerate(levels):
        made = encoder.encode(grey(level, width, height), number * 3000, number == 0)
        found.append(Encoded(codec, number / 30, made.keyframe, made.data))
    return found


class Heard:
    """What the process says; `level` is how bright each picture is in the middle."""

    def __init__(self, spec: SourceSpec | None = None) -> None:
        self.said: list[Said] = []
        self.pictures = PublishedPictures(spec or camera(), self.said.append)

    @property
    def captured(self) -> list[Captured]:
        return [each for each in self.said if isinstance(each, Captured)]

    @property
    def troubles(self) -> list[Trouble]:
        return [each for each in self.said if isinstance(each, Trouble)]


def level(picture: Captured) -> int:
    luma = np.frombuffer(picture.payload, np.uint8, picture.width * picture.height)
    return int(luma.reshape(picture.height, picture.width)[picture.height // 2, picture.width // 2])


@pytest.mark.parametrize("codec", CODECS)
def test_each_picture_comes_out_at_once_with_the_time_of_its_own_capture(codec: PictureCodec) -> None:
    heard = Heard()
    levels = [40, 80, 120, 160, 200]
    for number, picture in enumerate(encoded(codec, levels)):
        heard.pictures.take(picture)
        assert len(heard.captured) == number + 1
    assert [each.time for each in heard.captured] == [number / 30 for number in range(5)]
    assert [level(each) for each in heard.captured] == pytest.approx(levels, abs=6)
    assert heard.said[0] == Working("160x120")
    assert {(each.codec, each.width, each.height) for each in heard.captured} == {("yuv420p", 160, 120)}


@pytest.mark.parametrize("codec", CODECS)
def test_a_picture_without_a_time_is_decoded_and_shown_to_nobody(codec: PictureCodec) -> None:
    heard = Heard()
    first, second, third = encoded(codec, [40, 120, 200])
    for picture in (first, Encoded(codec, None, second.keyframe, second.data), third):
        heard.pictures.take(picture)
    assert [level(each) for each in heard.captured] == pytest.approx([40, 200], abs=6)


@pytest.mark.parametrize("codec", CODECS)
def test_what_is_no_picture_is_said_and_only_a_keyframe_helps(codec: PictureCodec) -> None:
    heard = Heard()
    first, second, third = encoded(codec, [40, 80, 120])
    heard.pictures.take(second)  # nothing to build on
    assert heard.said == []
    heard.pictures.take(first)
    nonsense = {"VP8": b"\xfe" + bytes(5), "H264": b"\x00\x00\x00\x01\x67\xff\xff\xff"}
    heard.pictures.take(Encoded(codec, 1.0, True, nonsense[codec]))
    assert [each.reason for each in heard.troubles] == ["not_media"]
    heard.pictures.take(third)
    assert len(heard.captured) == 1
    for picture in encoded(codec, [200]):
        heard.pictures.take(Encoded(codec, 2.0, picture.keyframe, picture.data))
    assert [level(each) for each in heard.captured] == pytest.approx([40, 200], abs=6)


def test_an_h264_picture_with_damage_in_it_is_shown_to_nobody() -> None:
    """A decoder would rather invent what is missing than say so."""
    chance = np.random.default_rng(5)
    encoder = create_picture_encoder("H264", 4_000_000, 30.0)
    noise = chance.integers(0, 255, (180, 160), np.uint8)
    made = encoder.encode(av.VideoFrame.from_ndarray(noise, format="yuv420p"), 0, True)
    whole = Heard()
    whole.pictures.take(Encoded("H264", 0.0, True, made.data))
    assert len(whole.captured) == 1
    for cut in (0.5, 0.8, 0.95):
        heard = Heard()
        heard.pictures.take(Encoded("H264", 0.0, True, made.data[: int(len(made.data) * cut)]))
        assert heard.captured == []


@pytest.mark.parametrize(("width", "height"), [(1920, 1090), (4096, 2304)])
def test_pictures_of_more_pixels_than_a_screen_are_refused_before_they_take_memory(width: int, height: int) -> None:
    heard = Heard()
    for picture in encoded("H264", [90], width, height):
        heard.pictures.take(picture)
    assert heard.captured == []
    assert [each.reason for each in heard.troubles] == ["not_media"]


def test_the_size_and_rate_of_the_camera_are_kept_and_no_more_than_thirty_a_second_go_on() -> None:
    heard = Heard(camera("phone#size=80x60,rate=10"))
    for picture in encoded("VP8", [100] * 30):
        heard.pictures.take(picture)
    assert 9 <= len(heard.captured) <= 11
    assert {(each.width, each.height) for each in heard.captured} == {(80, 60)}
    quick = Heard()
    for number, picture in enumerate(encoded("VP8", [100] * 120)):
        quick.pictures.take(Encoded("VP8", number / 120, True, picture.data))
    assert len(quick.captured) <= math.ceil(MAX_RATE) + 1


def test_the_wire_gives_back_what_was_put_on_it_and_nothing_else() -> None:
    pictures = [Encoded("VP8", 1.5, True, b"x" * 70_000), Encoded("H264", None, False, b"")]
    file = io.BytesIO(b"".join(map(PICTURES.encode, pictures)))
    assert [PICTURES.read(file), PICTURES.read(file), PICTURES.read(file)] == [*pictures, None]
    for nonsense in (b"\xff\xff\xff\xff", b"\x00\x00\x00\x02\x91", b"\x00\x00\x00\x01\xc0", b"\x00"):
        assert PICTURES.read(io.BytesIO(nonsense)) is None
