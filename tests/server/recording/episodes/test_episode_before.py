"""What the next process of a console says of the last episode that was recorded."""

from pathlib import Path

import msgspec
import pytest

from lockstep.server.recording.episodes.edits import edits_path
from lockstep.server.recording.episodes.episode_before import EpisodeBefore, episode_before
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.makers import INTERVAL, START, Story
from tests.server.recording.test_episode_export import KEPT_AND_NOT, OTHER, changed, episode, recording

NOW = (START + 101 * INTERVAL) / 1e9  # s since 1970, just behind the recordings
BEGUN = episode("a", "start", 10, 10)


def said(directory: Path, *, now: float = NOW) -> EpisodeBefore | None:
    return episode_before(RecordingStore(directory, RecordingSettings()), now)


@pytest.mark.parametrize(
    ("records", "expected"),
    [
        ((), None),
        ((BEGUN, episode("a", "kept", 10, 20)), EpisodeBefore("a", 1, "kept", "console_ended", "push")),
        ((BEGUN, episode("a", "discarded", 10, 20)), EpisodeBefore("a", 1, "discarded", "console_ended", "push")),
        ((BEGUN,), EpisodeBefore("a", 1, "open", "console_ended", "push")),
        ((BEGUN, episode("a", "cut", 10, 20, why="epoch")), EpisodeBefore("a", 1, "cut", "epoch", "push")),
        ((BEGUN, episode("a", "cut", 10, 20, why="no word")), EpisodeBefore("a", 1, "cut", "console_ended", "push")),
    ],
)
def test_the_last_episode_is_what_the_file_says(
    tmp_path: Path, records: tuple[Entry, ...], expected: EpisodeBefore | None
) -> None:
    recording(tmp_path / "a.mcap", *records, events=30)
    assert said(tmp_path) == expected


def test_it_is_of_the_recording_that_ended_last_and_has_one_with_the_changes_to_it(tmp_path: Path) -> None:
    new = recording(tmp_path / "a.mcap", *KEPT_AND_NOT[:6])
    recording(tmp_path / "b.mcap", BEGUN, events=20, info=OTHER)
    recording(tmp_path / "c.mcap", events=200, info=msgspec.structs.replace(OTHER, part=2))
    (tmp_path / "d.mcap").write_bytes(b"no recording")
    (tmp_path / "e.mcap").symlink_to("/nowhere")
    changed(new, "c", dropped=True, task="sweep")
    writer = Story().write(tmp_path / "written.mcap", close=False)
    assert said(tmp_path) == EpisodeBefore("c", 1, "discarded", "console_ended", "sweep")
    writer.close()
    edits_path(new).unlink()
    edits_path(new).symlink_to("/nowhere")
    assert said(tmp_path) == EpisodeBefore("c", 1, "kept", "console_ended", "wipe"), "as it was recorded"


def test_nobody_is_told_of_an_old_recording_or_of_none(tmp_path: Path) -> None:
    recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    assert said(tmp_path) is not None
    assert said(tmp_path, now=NOW + 700) is None
    assert said(tmp_path / "not there") is None
