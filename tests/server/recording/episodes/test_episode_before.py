"""What the next process of a console says of the last episode that was recorded."""

import os
import time
from pathlib import Path

import pytest

from lockstep.server.recording.episodes.episode_before import EpisodeBefore, episode_before
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.makers import INTERVAL, START, Story
from tests.server.recording.test_episode_export import KEPT_AND_NOT, changed, episode, recording

NOW = (START + 101 * INTERVAL) / 1e9  # s since 1970, just behind the recordings
BEGUN = episode("a", "start", 10, 10)


def said(directory: Path, *, now: float = NOW, killed: bool = False) -> EpisodeBefore | None:
    store = RecordingStore(directory, RecordingSettings())
    return episode_before(store, set(store.files()) if killed else set(), now)


@pytest.mark.parametrize(
    ("records", "killed", "expected"),
    [
        ((), False, None),
        ((BEGUN, episode("a", "kept", 10, 20)), True, EpisodeBefore(1, "kept", "console_ended", "push")),
        ((BEGUN, episode("a", "discarded", 10, 20)), False, EpisodeBefore(1, "discarded", "recording_failed", "push")),
        ((BEGUN,), True, EpisodeBefore(1, "open", "console_ended", "push")),
        ((BEGUN,), False, EpisodeBefore(1, "open", "recording_failed", "push")),
        ((BEGUN, episode("a", "cut", 10, 20, why="epoch")), False, EpisodeBefore(1, "cut", "epoch", "push")),
        ((BEGUN, episode("a", "cut", 10, 20, why="no word")), True, EpisodeBefore(1, "cut", "console_ended", "push")),
    ],
)
def test_the_last_episode_is_what_the_file_says(
    tmp_path: Path, records: tuple[Entry, ...], killed: bool, expected: EpisodeBefore | None
) -> None:
    recording(tmp_path / "a.mcap", *records, events=30)
    assert said(tmp_path, killed=killed) == expected


def test_it_is_of_the_newest_file_with_the_changes_to_it_and_not_of_one_that_is_written(tmp_path: Path) -> None:
    old, new = (recording(tmp_path / f"{name}.mcap", *KEPT_AND_NOT[:6]) for name in "ba")
    os.utime(old, (time.time() - 5, time.time() - 5))
    changed(new, "c", dropped=True, task="sweep")
    writer = Story().write(tmp_path / "written.mcap", close=False)
    assert said(tmp_path) == EpisodeBefore(1, "discarded", "recording_failed", "sweep")
    writer.close()
    assert said(tmp_path) is None, "the newest recording has no episode"


def test_nobody_is_told_of_an_old_recording_or_of_what_is_none(tmp_path: Path) -> None:
    recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    assert said(tmp_path) is not None
    assert said(tmp_path, now=NOW + 700) is None
    (tmp_path / "z.mcap").write_bytes(b"no recording")
    assert said(tmp_path) is None
    assert said(tmp_path / "not there") is None
