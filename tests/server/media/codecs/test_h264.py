from typing import Any

import av
import pytest
from av.video.frame import PictureType

from lockstep.server.media.codecs.h264 import START_CODE, Profile, accepts, inspect, profile_of_fmtp
from tests.server.media.camera_h264 import access_units

CONSTRAINED, BASELINE, MAIN, HIGH = (profile_of_fmtp(text) for text in ("42e01f", "42001f", "4d001f", "64001f"))


@pytest.mark.parametrize(("name", "idc"), [("baseline", 66), ("main", 77), ("high", 100)])
def test_an_encoders_profile_and_keyframes_are_found(name: str, idc: int) -> None:
    units = [inspect(unit) for unit in access_units(7, profile=name)]
    assert [unit.keyframe for unit in units] == [True] + 4 * [False] + [True, False]
    assert units[0].profile is not None
    assert units[0].profile.idc == idc
    assert units[0].parameter_sets.count(START_CODE) == 2
    assert units[1].profile is None
    assert not any(unit.reordered for unit in units)


def test_b_pictures_are_found() -> None:
    assert any(inspect(unit).reordered for unit in access_units(12, profile="main", b_frames=2))


def test_what_is_no_h264_is_no_keyframe_of_anything() -> None:
    for data in (b"", b"no start code", START_CODE, START_CODE + b"\x01", START_CODE + b"\x67\x42", b"\x00" * 40):
        access = inspect(data)
        assert (access.keyframe, access.profile, access.reordered) == (False, None, False)


@pytest.mark.parametrize(
    ("negotiated", "stream", "fits"),
    [
        (CONSTRAINED, CONSTRAINED, True),
        (BASELINE, CONSTRAINED, True),
        (MAIN, CONSTRAINED, True),
        (HIGH, CONSTRAINED, True),
        (CONSTRAINED, BASELINE, False),
        (BASELINE, BASELINE, True),
        (MAIN, BASELINE, False),
        (CONSTRAINED, MAIN, False),
        (MAIN, MAIN, True),
        (HIGH, MAIN, True),
        (MAIN, HIGH, False),
        (HIGH, HIGH, True),
        (HIGH, Profile(122, 0, 31), False),
    ],
)
def test_a_larger_profile_takes_the_smaller_ones(negotiated: Profile, stream: Profile, fits: bool) -> None:
    assert accepts(negotiated, stream) is fits


def test_what_is_no_profile_level_id_is_constrained_baseline() -> None:
    assert profile_of_fmtp("rubbish").constrained
    assert profile_of_fmtp("").constrained
    assert str(profile_of_fmtp("64001f")) == "64001f"


def test_our_own_reading_agrees_with_a_decoder() -> None:
    context: Any = av.CodecContext.create("h264", "r")
    frames = [
        frame for unit in access_units(12, profile="main", b_frames=2) for frame in context.decode(av.Packet(unit))
    ]
    frames += context.decode(None)
    reordered = [inspect(unit).reordered for unit in access_units(12, profile="main", b_frames=2)]
    assert sum(frame.pict_type == PictureType.B for frame in frames) == sum(reordered)
