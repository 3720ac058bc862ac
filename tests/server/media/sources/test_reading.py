"""What one source's process does, here without a process of its own."""

import itertools
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from lockstep.server.media.codecs.h264 import inspect
from lockstep.server.media.sources.errors import reason_of
from lockstep.server.media.sources.reader import read_source
from lockstep.server.media.sources.source_url import parse_source
from lockstep.server.media.sources.source_wire import Captured, Said, Trouble, Working
from tests.server.media.sources.media_files import film, tone


def read(kind: str, text: str, count: int, wanted: Callable[[Said], bool] = lambda _: True) -> list[Said]:
    """What is said until `count` of what is wanted was."""
    found: list[Said] = []

    def say(said: Said) -> None:
        found.append(said)
        if sum(map(wanted, found)) >= count:
            raise BrokenPipeError

    with suppress(BrokenPipeError):  # nobody listens any more
        read_source(parse_source("video" if kind == "video" else "audio", text), say, sleep=lambda seconds: None)
    return found


def media(found: list[Said]) -> list[Captured]:
    return [said for said in found if isinstance(said, Captured)]


@pytest.mark.parametrize("name", ["film.mp4", "film.ts", "film.mkv"])
def test_h264_goes_on_as_it_is_with_parameter_sets_on_every_keyframe(tmp_path: Path, name: str) -> None:
    found = read("video", f"file:{film(tmp_path / name)}", 34)
    assert found[0] == Working("h264 160x120")
    pictures = media(found)
    assert {picture.codec for picture in pictures} == {"h264"}
    assert [picture.keyframe for picture in pictures[:21]] == [i % 10 == 0 for i in range(21)]
    assert all(inspect(picture.payload).profile is not None for picture in pictures if picture.keyframe)
    assert pictures[30].keyframe  # the film began again
    times = [picture.time for picture in pictures]
    assert times == sorted(times)
    assert times[-1] <= time.monotonic()


@pytest.mark.parametrize(
    ("codec", "name", "b_frames", "options", "given"),
    [
        ("libx264", "film.mp4", 2, "", ("yuv420p", 160, 120)),
        ("libx264", "film.mp4", 0, "#size=80x60", ("yuv420p", 80, 60)),
        ("libvpx", "film.mkv", 0, "", ("yuv420p", 160, 120)),
        ("mjpeg", "film.avi", 0, "", ("mjpeg", 160, 120)),
        ("mjpeg", "film.avi", 0, "#size=80x60", ("yuv420p", 80, 60)),
    ],
)
def test_what_cannot_go_on_as_it_is_is_decoded(
    tmp_path: Path, codec: str, name: str, b_frames: int, options: str, given: tuple[str, int, int]
) -> None:
    found = media(read("video", f"file:{film(tmp_path / name, codec, count=12, b_frames=b_frames)}{options}", 10))
    assert {(picture.codec, picture.width, picture.height) for picture in found} == {given}
    assert all(len(picture.payload) == given[1] * given[2] * 3 // 2 for picture in found if given[0] == "yuv420p")
    assert all(a.time <= b.time for a, b in itertools.pairwise(found))


def test_a_lower_rate_leaves_pictures_out(tmp_path: Path) -> None:
    found = media(read("video", f"file:{film(tmp_path / 'film.avi', 'mjpeg')}#rate=10", 5))
    assert found[-1].time - found[0].time > 0.25  # at the file's own rate 0.13 s; a busy machine shortens 0.4 s a bit


def test_sound_comes_as_samples_with_the_time_of_the_first(tmp_path: Path) -> None:
    found = media(read("audio", f"file:{tone(tmp_path / 'tone.wav')}#latency=0.5", 12))
    assert {(sound.codec, sound.sample_rate, sound.channels) for sound in found} == {("pcm_s16le", 16_000, 1)}
    assert found[-1].time <= time.monotonic() - 0.5
    assert all(0 < len(sound.payload) <= 16_000 for sound in found)


@pytest.mark.parametrize(
    ("kind", "text", "reason"),
    [
        ("video", "file:/no/such/file.mp4", "not_found"),
        ("video", "tcp://user:geheim@127.0.0.1:1", "refused"),
        ("video", "rtsp://user:geheim@127.0.0.1:1/x", "refused"),
        ("audio", "file:SELF", "not_media"),
        ("video", "file:TONE", "no_such_medium"),
        ("audio", "file:FILM", "no_such_medium"),
        ("video", "nonsense://geheim", "unknown_protocol"),
    ],
)
def test_what_fails_is_said_with_its_reason_without_its_address_and_tried_again(
    tmp_path: Path, kind: str, text: str, reason: str
) -> None:
    text = text.replace("SELF", __file__).replace("TONE", str(tone(tmp_path / "t.wav")))
    text = text.replace("FILM", str(film(tmp_path / "f.mp4", count=3)))
    found = read(kind, text, 2, lambda said: isinstance(said, Trouble))
    assert {said.reason for said in found if isinstance(said, Trouble)} == {reason}
    assert not any("geheim" in repr(said) or "127.0.0.1" in repr(said) for said in found)


def test_an_error_of_a_library_is_never_quoted() -> None:
    error = ValueError("rtsp://user:geheim@host")
    assert reason_of(error) == ("failed", "failed")
    assert reason_of(OSError(5, "Input/output error", "rtsp://user:geheim@host")) == ("failed", "input/output error")
