"""The directory of recordings is kept within its bounds, and its faults stop nothing."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.retention import Retention
from lockstep.server.recording.settings import RecordingSettings
from tests.server.recording.makers import Story


class Trail:
    """What an audit got."""

    def __init__(self) -> None:
        self.said: list[tuple[str, str]] = []

    def record(self, kind: str, *, what: str, detail: str) -> None:
        self.said.append((what, detail))


def made(directory: Path) -> tuple[Retention, Trail]:
    trail: Any = Trail()
    return Retention(RecordingStore(directory, RecordingSettings(age_days=1)), trail), trail


async def test_what_is_too_old_is_deleted_and_said_in_the_audit(tmp_path: Path) -> None:
    retention, trail = made(tmp_path / "new")
    await retention.prepare()
    assert trail.said == []
    for name in ("old", "older", "young"):
        Story(events=5).write(tmp_path / "new" / f"{name}.mcap")
    os.utime(tmp_path / "new" / "old.mcap", (2e6, 2e6))
    os.utime(tmp_path / "new" / "older.mcap", (1e6, 1e6))
    await retention.prune()
    assert trail.said == [("deleted to make room", "older"), ("deleted to make room", "old")]
    assert [path.stem for path in (tmp_path / "new").iterdir()] == ["young"]


async def test_a_directory_that_cannot_be_used_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unreadable(self: RecordingStore) -> list[Path]:
        raise OSError(errno.EIO, "Input/output error")

    retention, trail = made(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(RecordingStore, "files", unreadable)
        await retention.prepare()
        await retention.prune()
    Story(events=5).write(tmp_path / "old.mcap")
    os.utime(tmp_path / "old.mcap", (1e6, 1e6))
    await retention.prune()
    assert trail.said == [("deleted to make room", "old")]
