"""A picture of a recording by event: it is the one that a dataset's row of that event has."""

import io
from pathlib import Path

import av
import pytest

from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.format.records import Degraded
from lockstep.server.recording.reading import picture_at as module
from lockstep.server.recording.reading.picture_at import PictureAt, picture_at
from lockstep.server.recording.reading.reader import RecordingReader
from tests.server.recording.makers import EPOCH, INTERVAL, START, Story, own_entry
from tests.server.recording.test_episode_export import recording


def shown(path: Path, event: int, width: int = 160) -> PictureAt | None:
    with RecordingReader(path) as reader:
        return picture_at(reader, "front", event, width)


def brightness(jpeg: bytes) -> float:
    with av.open(io.BytesIO(jpeg), "r") as image:
        (frame,) = image.decode(video=0)
        return float(frame.to_ndarray(format="gray")[20:100, 20:100].mean())


@pytest.mark.parametrize("codecs", [("H264",), ("VP8",), ("H264", "VP8")])
def test_a_picture_is_the_one_of_its_event(tmp_path: Path, codecs: tuple[str, ...]) -> None:
    path = tmp_path / "a.mcap"
    Story(events=120, real=True, codecs=codecs).write(path)
    for event in (2, 30, 51, 52, 53, 101, 120):
        found = shown(path, event)
        assert found is not None
        assert found.stamp == event
        assert brightness(found.jpeg) == pytest.approx(2 * event, abs=8)


def test_without_a_picture_of_the_event_it_is_the_newest_older_one(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", events=40, stamps={20: 19, 21: 19, 22: 19})
    found = shown(path, 22)
    assert found is not None
    assert found.stamp == 19


def test_of_several_with_the_stamp_it_is_the_first(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", events=40, stamps={21: 20, 22: 20})
    found = shown(path, 20)
    assert found is not None
    assert brightness(found.jpeg) == pytest.approx(40, abs=3)


def test_a_picture_is_no_wider_than_asked_and_never_enlarged(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=10, real=True).write(path)
    for width, wide in ((160, 160), (640, 320)):
        found = shown(path, 5, width)
        assert found is not None
        with av.open(io.BytesIO(found.jpeg), "r") as image:
            assert (image.streams.video[0].width, image.streams.video[0].height) == (wide, wide * 3 // 4)


def test_before_the_first_picture_and_of_no_camera_there_is_none(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=10, real=True).write(path)
    assert shown(path, 1) is None
    with RecordingReader(path) as reader:
        assert picture_at(reader, "back", 5, 160) is None


def test_a_picture_that_builds_on_one_that_was_left_out_is_not_shown(tmp_path: Path) -> None:
    lost = own_entry(Degraded(epoch=EPOCH, event=20, lost=1), START + 19 * INTERVAL + 20_000_000)
    path = recording(tmp_path / "a.mcap", lost, events=80)
    found = shown(path, 19)
    assert found is not None
    assert found.stamp == 19
    assert shown(path, 30) is None
    assert shown(path, 60) is not None, "behind the next keyframe"


def test_a_picture_that_came_late_behind_what_was_left_out_is_not_shown(tmp_path: Path) -> None:
    """The recorder says at event 31 that it left something out; then come the pictures of 21 to 30."""
    lost = own_entry(Degraded(epoch=EPOCH, event=31, lost=1), START + 25 * INTERVAL + 1_000_000)
    path = recording(tmp_path / "a.mcap", lost, events=80, stamps={event: event - 5 for event in range(27, 36)})
    assert shown(path, 28) is None


def test_what_is_left_out_behind_a_picture_does_not_hide_it(tmp_path: Path) -> None:
    lost = own_entry(Degraded(epoch=EPOCH, event=24, lost=1), START + 23 * INTERVAL + 1_000_000)
    path = recording(tmp_path / "a.mcap", lost, events=40, stamps={20: 19, 21: 19, 22: 19, 23: 25, 24: 25})
    found = shown(path, 22)
    assert found is not None
    assert found.stamp == 19


def test_pictures_that_are_none_and_too_many_from_a_keyframe_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    Story(events=40).write(path)
    with pytest.raises(RecordingDamaged, match="cannot be decoded"):
        shown(path, 20)
    monkeypatch.setattr(module, "MAX_PICTURES", 5)
    with pytest.raises(RecordingDamaged, match="more than 5 pictures"):
        shown(path, 20)
