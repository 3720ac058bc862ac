from pathlib import Path

import pytest

from lockstep.server.recording.reading import known_indexes
from lockstep.server.recording.reading.known_indexes import KnownIndexes
from tests.server.recording.makers import Story


def test_an_index_is_read_once_and_again_when_the_file_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "one.mcap"
    Story(events=10).write(path)
    indexes = KnownIndexes()
    with indexes.open(path) as first, indexes.open(path) as second:
        assert second.index is first.index
        assert [each.event for each in second.records(5, 5)] == [each.event for each in first.records(5, 5)]
    path.unlink()
    Story(events=20).write(path)
    with indexes.open(path) as changed:
        assert changed.index.last_event == 20


def test_what_was_interrupted_stays_so(tmp_path: Path) -> None:
    path = tmp_path / "interrupted.mcap"
    writer = Story(events=60).write(tmp_path / "one.mcap", close=False)
    path.write_bytes((tmp_path / "one.mcap").read_bytes())
    writer.close()
    indexes = KnownIndexes()
    with indexes.open(path) as first, indexes.open(path) as second:
        assert first.interrupted
        assert second.interrupted


def test_only_a_few_are_remembered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(known_indexes, "MOST", 1)
    indexes = KnownIndexes()
    paths = [tmp_path / "one.mcap", tmp_path / "two.mcap"]
    for path in paths:
        Story(events=5).write(path)
        indexes.open(path).close()
    with indexes.open(paths[0]) as again, indexes.open(paths[0]) as same:
        assert again.index is same.index
