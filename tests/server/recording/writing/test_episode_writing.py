"""Episodes on their way to the disk: one is said to be kept only when it is there, and whole in one file."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from lockstep.protocol.messages import Feedback
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import EpisodeRecord, RobotRecord
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.writing import recording_queue
from lockstep.server.recording.writing.queue_items import FeedbackItem, MediaItem, OwnItem, RobotItem
from lockstep.server.recording.writing.writer_thread import RecordingThread
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, START


class Made:
    """A thread, and what it says of episodes."""

    def __init__(self, directory: Path, **settings: Any) -> None:
        self.said: list[tuple[str, bool]] = []
        self.thread = RecordingThread(
            directory,
            RecordingSettings(**({"free_bytes": 0} | settings)),
            RecordingInfo(recording="r"),
            lambda: START,
            lambda: None,
            lambda: None,
            None,
            lambda episode, kept: self.said.append((episode, kept)),
        )
        self.robot()

    def robot(self, epoch: str = EPOCH) -> None:
        record = RobotRecord(epoch=epoch, event=1, link="up", description=DESCRIPTION)
        self.thread.queue.put(RobotItem(START, record, CODECS))

    def event(self, event: int, size: int = 1000) -> None:
        feedback = Feedback(event=event, issue=1, time=float(event), axes=[0.0, 0.0], joints=[1.0, 2.0, 3.0])
        self.thread.queue.put(FeedbackItem(START, START, EPOCH, feedback))
        data = b"\0\0\0\1\x65" + os.urandom(size)
        self.thread.queue.put(MediaItem(START, START, EPOCH, "front", "H264", event, True, data))

    def episode(self, id: str, kind: str, event: int) -> None:
        record = EpisodeRecord(
            epoch=EPOCH,
            event=event,
            episode=id,
            number=1,
            kind=kind,  # type: ignore[arg-type]
            task="x",
            first_event=1,
            last_event=event,
        )
        self.thread.queue.put(OwnItem(START, record))

    def run(self) -> None:
        self.thread.start()
        self.thread.close()


def found(path: Path) -> list[EpisodeEntry]:
    with RecordingReader(path) as reader:
        return reader.index.episodes


def test_what_was_kept_is_said_when_it_is_on_the_disk(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.episode("a", "start", 1)
    made.event(5)
    made.episode("a", "kept", 5)
    made.run()
    assert made.said == [("a", True)]
    assert [each.state for each in found(tmp_path / "r.mcap")] == ["kept"]


def test_a_file_does_not_end_in_an_episode_before_it_is_twice_as_long(tmp_path: Path) -> None:
    made = Made(tmp_path, file_bytes=1_000_000)
    made.episode("a", "start", 1)
    for event in range(1, 8):
        made.event(event, 200_000)
    made.episode("a", "kept", 8)
    made.run()
    assert made.said == [("a", True)]
    assert [each.state for each in found(tmp_path / "r.mcap")] == ["kept"]


def test_an_episode_that_a_new_file_cuts_is_not_kept_in_either(tmp_path: Path) -> None:
    made = Made(tmp_path, file_bytes=1_000_000)
    made.episode("a", "start", 1)
    for event in range(1, 20):
        made.event(event, 200_000)
    made.episode("a", "kept", 20)
    made.run()
    assert made.said == [("a", False), ("a", False)]
    assert all(each.state == "open" for path in tmp_path.glob("*.mcap") for each in found(path))


def test_an_episode_of_the_epoch_before_is_not_kept(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.episode("a", "start", 1)
    made.robot("epoch-2")
    made.episode("a", "kept", 5)
    made.run()
    assert ("a", True) not in made.said
    assert [each.state for each in found(tmp_path / "r.mcap")] == ["open"]


def test_records_of_episodes_find_a_place_when_the_disk_is_too_slow_for_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_queue, "MAX_WAITING", 5)
    made = Made(tmp_path)
    made.episode("a", "start", 1)
    for event in range(1, 20):
        made.event(event)
    made.episode("a", "kept", 20)
    made.run()
    assert made.thread.queue.lost > 0
    assert made.said == [("a", True)]
    assert [each.state for each in found(tmp_path / "r.mcap")] == ["kept"]


def test_an_episode_whose_end_the_disk_does_not_take_is_not_kept_nor_in_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk fails once, right where the episode's end is to be synchronised, and works again afterwards."""
    real, fails = os.fdatasync, [True]

    def sync(descriptor: int) -> None:
        if made.thread.parts._is_keeping and fails:
            fails.clear()
            raise OSError(errno.ENOSPC, "No space left on device")
        real(descriptor)

    made = Made(tmp_path)
    monkeypatch.setattr(os, "fdatasync", sync)
    made.episode("a", "start", 1)
    made.event(5)
    made.episode("a", "kept", 5)
    made.run()
    assert "No space left" in made.thread.failure
    assert ("a", True) not in made.said
    left = [each.state for path in tmp_path.glob("*.mcap") for each in found(path)]
    assert "kept" not in left


def heads(directory: Path) -> list[tuple[str, str, str]]:
    """Of each part: whether episodes were begun before it, the episode that was open, and how the file ended."""
    found: list[tuple[str, str, str]] = []
    for path in sorted(directory.glob("*.mcap"), key=lambda each: (len(each.name), each.name)):
        with RecordingReader(path) as reader:
            found.append((reader.info.episodes, reader.info.cut, reader.index.ending))
    return found


def test_each_part_says_whether_an_episode_was_begun_before_it_and_which_is_open(tmp_path: Path) -> None:
    made = Made(tmp_path, file_bytes=1_000_000)
    made.event(1, 1_100_000)
    made.episode("a", "start", 1)
    for event in range(2, 5):
        made.event(event, 1_100_000)
    made.episode("a", "mark", 5)
    made.event(6, 1_100_000)
    made.episode("a", "discarded", 6)
    made.event(7, 1_100_000)
    made.run()
    assert heads(tmp_path) == [
        ("none", "", "continued"),
        ("none", "", "continued"),
        ("begun", "a", "continued"),
        ("begun", "a", "continued"),
        ("begun", "a", "continued"),
        ("begun", "", "episodes"),
    ]


def test_a_new_epoch_ends_an_episode_also_when_its_end_is_in_no_file(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.episode("a", "start", 1)
    made.robot("epoch-2")
    made.episode("a", "cut", 1)
    made.robot("epoch-3")
    made.run()
    assert heads(tmp_path) == [("none", "", "continued"), ("begun", "a", "continued"), ("begun", "", "episodes")]


def test_a_recording_in_which_nobody_began_an_episode_says_so_at_its_end(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.event(1)
    made.run()
    assert heads(tmp_path) == [("none", "", "no_episodes")]
