"""The directory of recordings: what is listed, what is completed, and what is deleted to make room."""

import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path, PurePath

import msgspec
import pytest

from lockstep.server.recording import recording_store as shelf_module
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.settings import RecordingSettings
from tests.server.recording.makers import Story

DAY = 86_400


def shelf(directory: Path, total: int = 1_000_000_000, days: float = 30.0) -> RecordingStore:
    return RecordingStore(directory, RecordingSettings(total_bytes=max(1_000_000, total), age_days=days))


def aged(path: Path, days: float) -> Path:
    then = time.time() - days * DAY
    os.utime(path, (then, then))
    return path


def made(path: Path, events: int = 10) -> Path:
    Story(events=events).write(path)
    return path


def large(path: Path, size: int) -> Path:
    path.write_bytes(bytes(size))
    return path


def interrupted(path: Path, events: int = 100) -> Path:
    """As a killed console leaves it: neither closed nor locked."""
    writer = Story(events=events).write(path.with_suffix(".open"), close=False)
    path.write_bytes(path.with_suffix(".open").read_bytes())
    writer.close()
    path.with_suffix(".open").unlink()
    return path


def test_recordings_are_listed_and_what_is_none_is_passed_over(tmp_path: Path) -> None:
    made(tmp_path / "one.mcap", 20)
    (tmp_path / "notes.txt").write_text("no recording")
    (tmp_path / "other.mcap").write_bytes(b"\x89MCAP0\r\nnone of ours")
    (tmp_path / "directory.mcap").mkdir()
    (entry,) = shelf(tmp_path).entries()
    assert (entry.id, entry.name, entry.by, entry.robot) == ("one", "first", "Ada", "Planar robot")
    assert (entry.first_event, entry.last_event, entry.interrupted, entry.running) == (1, 20, False, False)
    assert entry.bytes == (tmp_path / "one.mcap").stat().st_size


def test_a_file_that_changed_is_read_again_and_one_that_is_gone_is_forgotten(tmp_path: Path) -> None:
    found = shelf(tmp_path)
    path = made(tmp_path / "one.mcap", 20)
    assert [entry.last_event for entry in found.entries()] == [20]
    path.unlink()
    made(path, 30)
    assert [entry.last_event for entry in found.entries()] == [30]
    path.unlink()
    assert found.entries() == []
    assert found.path("one") is None


def test_the_file_that_is_being_written_is_neither_listed_completed_nor_deleted(tmp_path: Path) -> None:
    writer = Story(events=100).write(tmp_path / "running.mcap", close=False)
    aged(tmp_path / "running.mcap", 100)
    found = shelf(tmp_path, days=1)
    assert found.entries() == []
    assert found.recover() == 0
    assert found.prune() == []
    writer.close()
    assert [entry.id for entry in found.entries()] == ["running"]


def test_an_interrupted_file_is_completed_once_and_one_that_holds_nothing_goes(tmp_path: Path) -> None:
    path = interrupted(tmp_path / "killed.mcap")
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(path.read_bytes()[:600])  # the head and a part of the first chunk
    found = shelf(tmp_path)
    assert [entry.interrupted for entry in found.entries() if entry.id == "killed"] == [True]
    assert found.recover() == 1
    assert found.recover() == 0
    assert not empty.exists()
    with RecordingReader(path) as reader:
        assert not reader.interrupted
        assert reader.index.last_event >= 75


def test_what_is_too_old_goes(tmp_path: Path) -> None:
    aged(made(tmp_path / "old.mcap"), 8)
    aged(made(tmp_path / "young.mcap"), 6)
    assert shelf(tmp_path, days=7).prune() == ["old"]
    assert [path.name for path in tmp_path.iterdir()] == ["young.mcap"]


def test_the_oldest_go_until_the_rest_fits_and_nothing_that_is_to_be_kept(tmp_path: Path) -> None:
    for days in (1, 2, 3, 4):
        aged(large(tmp_path / f"{days}.mcap", 600_000), days)
    found = shelf(tmp_path, total=1_300_000)
    assert found.prune(keep={tmp_path / "4.mcap"}) == ["3", "2"]
    assert sorted(path.stem for path in found.files()) == ["1", "4"]
    assert found.prune() == []


def test_what_cannot_be_looked_at_ends_nothing(tmp_path: Path) -> None:
    assert shelf(tmp_path / "none").entries() == []
    assert shelf(tmp_path / "none").prune() == []
    (tmp_path / "gone.mcap").symlink_to(tmp_path / "nowhere")
    assert shelf(tmp_path).prune() == []


def test_listing_many_recordings_compares_each_with_few_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The list is made in a thread, and whatever that computes holds up whoever drives."""
    count, content = 200, made(tmp_path / "0.mcap").read_bytes()
    for number in range(1, count):
        (tmp_path / f"{number}.mcap").write_bytes(content)
    found = shelf(tmp_path)
    assert len(found.entries()) == count
    compared, equal = 0, PurePath.__eq__

    def counting(self: PurePath, other: object) -> bool:
        nonlocal compared
        compared += 1
        return equal(self, other)

    monkeypatch.setattr(PurePath, "__eq__", counting)
    assert len(found.entries()) == count
    assert compared < 10 * count


def test_several_who_ask_for_the_list_at_once_have_each_file_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(20):
        made(tmp_path / f"{number}.mcap", 2)
    read: list[Path] = []

    def reading(path: Path) -> RecordingReader:
        read.append(path)
        return RecordingReader(path)

    monkeypatch.setattr("lockstep.server.recording.recording_store.RecordingReader", reading)
    found, begin = shelf(tmp_path), threading.Barrier(8)

    def ask(_: int) -> int:
        begin.wait()
        return len(found.entries())

    with ThreadPoolExecutor(8) as threads:
        assert [*threads.map(ask, range(8))] == [20] * 8
    assert len(read) == 20


def test_whoever_asks_again_and_again_costs_a_look_and_what_changes_is_in_the_list_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made(tmp_path / "one.mcap")
    writer = Story(events=100).write(tmp_path / "running.mcap", close=False)
    os.utime(tmp_path, (0, 0))  # what is done from now on is later, however coarse the clock of the disk is
    found, times = shelf(tmp_path), list[str]()

    def looked() -> list[Path]:
        times.append("looked")
        return RecordingStore.files(found)

    monkeypatch.setattr(shelf_module, "SETTLED_NS", 0)
    monkeypatch.setattr(shelf_module, "LIST_SECONDS", 1e9)
    monkeypatch.setattr(found, "files", looked)
    for _ in range(20):
        assert [entry.id for entry in found.entries()] == ["one"]
    assert len(times) == 1
    writer.close()
    assert {entry.id for entry in found.entries()} == {"one", "running"}, "it is finished"
    (tmp_path / "one.mcap").unlink()
    assert [entry.id for entry in found.entries()] == ["running"]
    assert len(times) == 3
    monkeypatch.setattr(shelf_module, "LIST_SECONDS", 0.0)
    found.entries()
    assert len(times) == 4, "a file that somebody copies here grows without a sign"


def test_a_link_to_what_is_elsewhere_is_neither_listed_nor_completed_nor_counted(tmp_path: Path) -> None:
    here, elsewhere = tmp_path / "left", tmp_path / "right"
    here.mkdir()
    elsewhere.mkdir()
    other = interrupted(elsewhere / "secret.mcap")
    before = other.read_bytes()
    (here / "secret.mcap").symlink_to(other)
    (here / "passwords.mcap").symlink_to("/etc/passwd")
    made(here / "own.mcap")
    found = shelf(here, days=1)
    assert [entry.id for entry in found.entries()] == ["own"]
    assert found.path("secret") is None
    assert found.recover() == 0
    assert other.read_bytes() == before
    (tmp_path / "link").symlink_to(here, target_is_directory=True)
    assert [entry.id for entry in shelf(tmp_path / "link").entries()] == ["own"], "the folder itself may be one"


def test_a_name_that_is_no_utf8_has_an_id_that_can_be_told_and_finds_it(tmp_path: Path) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\n1.mcap"))
    made(path)
    (entry,) = shelf(tmp_path).entries()
    assert entry.id == "\N{REPLACEMENT CHARACTER}\n1"
    assert msgspec.json.decode(msgspec.json.encode(entry))["id"] == entry.id
    assert shelf(tmp_path).path(entry.id) == path
