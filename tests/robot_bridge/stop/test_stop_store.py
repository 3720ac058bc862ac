"""What a bridge begins with, whatever it finds on its disk; and that what it writes is found again."""

import os
import shutil
from pathlib import Path

import pytest

from lockstep.robot_bridge.errors import StateDirInUse, StateDirUnusable
from lockstep.robot_bridge.stop.stop_latch import StopRecord
from lockstep.robot_bridge.stop.stop_store import (
    LATEST_CLOCK,
    MAX_NOTE,
    Found,
    Kept,
    StopStore,
    start_of,
    wall_microseconds,
)

STOPPED = StopRecord(stopped=True, by="Ada", reason="smoke", number=41, press="ab", presses=[("ab", 41)])
WALL = 1_000  # a clock that was set back: numbers on the disk are above it


def found(directory: Path, *older: Path) -> Found:
    store = StopStore(directory, older)
    try:
        return store.open()
    finally:
        store.close()


def kept_in(directory: Path, record: StopRecord, *, ended: bool = True) -> None:
    store = StopStore(directory)
    store.open()
    store.reserve(record.number)
    store.write(Kept(latch=record, ended=ended))
    store.close()


def test_a_new_directory_begins_unlatched(tmp_path: Path) -> None:
    start = start_of(found(tmp_path / "new" / "robot"), WALL)
    assert (start.record, start.numbers_after, start.stop_reason) == (StopRecord(), WALL, "")


def test_a_directory_that_somebody_made_beforehand_is_new(tmp_path: Path) -> None:
    (tmp_path / "lost+found").mkdir()
    assert start_of(found(tmp_path), WALL).stop_reason == ""


@pytest.mark.parametrize("record", [STOPPED, StopRecord(number=7)])
def test_a_bridge_that_ended_in_order_is_found_as_it_was(tmp_path: Path, record: StopRecord) -> None:
    kept_in(tmp_path, record)
    start = start_of(found(tmp_path), WALL)
    assert (start.record, start.stop_reason) == (record, "")
    assert start.numbers_after >= record.number


@pytest.mark.parametrize("record", [STOPPED, StopRecord(number=7)])
def test_a_bridge_that_did_not_end_in_order_begins_stopped(tmp_path: Path, record: StopRecord) -> None:
    kept_in(tmp_path, record, ended=False)
    start = start_of(found(tmp_path), WALL)
    assert start.record == record
    assert "did not shut down cleanly" in start.stop_reason
    assert start.numbers_after > record.number + 1000, "numbers that never reached the disk may have been given"


def test_a_used_directory_without_the_stop_file_begins_stopped_and_its_numbers_go_on(tmp_path: Path) -> None:
    kept_in(tmp_path, STOPPED)
    (tmp_path / "stop.json").unlink()
    start = start_of(found(tmp_path), WALL)
    assert start.stop_reason == "The robot's stop file is missing"
    assert start.numbers_after > STOPPED.number


@pytest.mark.parametrize(
    "data", [b"", b"{", b"\xff\xfe", b"[" * 100_000, b'{"version":2,"latch":{},"ended":true}', b'{"latch":{}}']
)
def test_a_stop_file_that_cannot_be_read_means_stopped(tmp_path: Path, data: bytes) -> None:
    kept_in(tmp_path, STOPPED)
    (tmp_path / "stop.json").write_bytes(data)
    start = start_of(found(tmp_path), WALL)
    assert start.stop_reason.startswith("The robot's stop file cannot be read (")
    assert start.numbers_after > STOPPED.number


def test_a_number_that_no_message_can_carry_is_unreadable(tmp_path: Path) -> None:
    kept_in(tmp_path, StopRecord(number=2**53))
    assert "cannot be read" in start_of(found(tmp_path), WALL).stop_reason


def test_with_both_files_lost_the_clock_goes_on_with_the_numbers(tmp_path: Path) -> None:
    kept_in(tmp_path, STOPPED)
    for path in tmp_path.iterdir():
        path.unlink()
    assert start_of(found(tmp_path), wall_microseconds()).numbers_after > STOPPED.number


@pytest.mark.parametrize(("clock", "after"), [(-5, 0), (2**60, LATEST_CLOCK)])
def test_a_clock_that_cannot_be_right_does_not_use_up_the_numbers(clock: int, after: int) -> None:
    assert start_of(Found(used=False, kept=None), clock).numbers_after == after


def test_a_damaged_reserve_counts_as_unknown(tmp_path: Path) -> None:
    kept_in(tmp_path, STOPPED)
    (tmp_path / "numbers.json").write_text("nonsense")
    assert found(tmp_path).reserved == 0


def test_a_second_bridge_is_told_that_the_directory_is_in_use(tmp_path: Path) -> None:
    first = StopStore(tmp_path)
    first.open()
    with pytest.raises(StateDirInUse, match=str(tmp_path)):
        StopStore(tmp_path).open()
    first.close()
    found(tmp_path)


def test_a_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StateDirUnusable, match="file"):
        StopStore(tmp_path / "file" / "robot").open()


@pytest.mark.parametrize("file", ["", "numbers.json", "stop.json"])
def test_a_directory_or_file_that_somebody_removes_meanwhile_is_made_again_with_its_lock(
    tmp_path: Path, file: str
) -> None:
    directory = tmp_path / "stops" / "planar"
    store = StopStore(directory)
    store.open()
    store.reserve(STOPPED.number)
    store.write(Kept(latch=StopRecord(), ended=False))
    assert store.is_there()
    if file:
        (directory / file).unlink()
    else:
        shutil.rmtree(tmp_path / "stops")
    assert not store.is_there()
    store.write(Kept(latch=STOPPED, ended=False))
    assert store.is_there()
    with pytest.raises(StateDirInUse):
        found(directory)
    store.close()
    start = start_of(found(directory), WALL)
    assert start.record == STOPPED
    assert start.numbers_after > STOPPED.number + 1000, "the reserve is there again too"


def test_a_directory_that_another_bridge_has_taken_meanwhile_is_left_to_it(tmp_path: Path) -> None:
    store, other = StopStore(tmp_path / "planar"), StopStore(tmp_path / "planar")
    store.open()
    (tmp_path / "planar").rename(tmp_path / "elsewhere")
    other.open()
    with pytest.raises(OSError, match="another bridge has taken"):
        store.write(Kept(latch=STOPPED, ended=True))
    assert not (tmp_path / "planar" / "stop.json").exists()
    store.close()
    other.close()


def test_what_is_written_is_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept_in(tmp_path, STOPPED)
    store = StopStore(tmp_path)
    store.open()

    def full(descriptor: int, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space"):
        store.write(Kept(latch=StopRecord(), ended=True))
    monkeypatch.undo()
    store.close()
    assert start_of(found(tmp_path), WALL).record == STOPPED


def test_files_are_their_owners_alone_and_reach_the_disk_with_their_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[str] = []
    fsync = os.fsync

    def watched(descriptor: int) -> None:
        synced.append(os.readlink(f"/proc/self/fd/{descriptor}"))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", watched)
    kept_in(tmp_path / "robot", STOPPED)
    assert synced[-2:] == [str(tmp_path / "robot" / "stop.new"), str(tmp_path / "robot")]
    assert {path.stat().st_mode & 0o777 for path in (tmp_path / "robot").iterdir()} == {0o600}


def test_what_a_bridge_said_of_its_end_is_the_reason_of_the_next_stop_and_of_no_later_one(tmp_path: Path) -> None:
    store = StopStore(tmp_path)
    store.open()
    store.write(Kept(latch=STOPPED, ended=False))
    store.note_end("The robot bridge hung" + "!" * 1000)
    store.close()
    start = start_of(found(tmp_path), WALL)
    assert start.stop_reason.startswith("The robot bridge hung!")
    assert len(start.stop_reason) == MAX_NOTE
    kept_in(tmp_path, STOPPED, ended=False)
    assert "did not shut down cleanly" in start_of(found(tmp_path), WALL).stop_reason


def test_what_a_bridge_said_of_its_end_counts_for_nothing_when_it_ended_in_order_after_all(tmp_path: Path) -> None:
    store = StopStore(tmp_path)
    store.open()
    store.note_end("it hung")
    store.write(Kept(latch=STOPPED, ended=True))
    store.close()
    assert start_of(found(tmp_path), WALL).stop_reason == ""


def test_a_full_disk_leaves_the_older_reserve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = StopStore(tmp_path)
    store.open()
    kept = store.reserve(5)

    def full(descriptor: int, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(os, "write", full)
        with pytest.raises(OSError, match="No space left"):
            store.reserve(7)
    store.close()
    assert found(tmp_path).reserved == kept > 5
    kept_in(tmp_path, STOPPED)
    assert found(tmp_path).reserved > kept, "the next one is read in its place"


def test_a_stop_in_an_older_directory_holds_in_the_new_one_that_takes_its_place(tmp_path: Path) -> None:
    kept_in(tmp_path / "older", STOPPED)
    start = start_of(found(tmp_path / "new", tmp_path / "older"), WALL)
    assert (start.record, start.stop_reason) == (STOPPED, "")
    assert start.numbers_after >= STOPPED.number


@pytest.mark.parametrize("others", [0, 90])
def test_of_several_older_directories_one_that_is_stopped_is_enough(tmp_path: Path, others: int) -> None:
    kept_in(tmp_path / "one", StopRecord(number=others))
    kept_in(tmp_path / "two", STOPPED)
    kept_in(tmp_path / "three", StopRecord(number=others + 1))
    start = start_of(found(tmp_path / "new", *(tmp_path / each for each in ("one", "two", "three"))), WALL)
    assert start.record == STOPPED
    assert start.numbers_after > others, "no number is given twice"


@pytest.mark.parametrize("harm", ["killed", "unreadable"])
def test_an_older_directory_that_was_not_left_in_order_means_stopped(tmp_path: Path, harm: str) -> None:
    kept_in(tmp_path / "older", StopRecord(number=7), ended=harm != "killed")
    if harm == "unreadable":
        (tmp_path / "older" / "stop.json").write_bytes(b"{")
    assert start_of(found(tmp_path / "new", tmp_path / "older"), WALL).stop_reason


def test_older_directories_that_are_released_stop_nothing_and_are_looked_at_once(tmp_path: Path) -> None:
    kept_in(tmp_path / "older", StopRecord(number=7))
    start = start_of(found(tmp_path / "new", tmp_path / "older"), WALL)
    assert (start.record.number, start.stop_reason) == (7, "")
    kept_in(tmp_path / "new", StopRecord(number=8))
    kept_in(tmp_path / "older", STOPPED)
    start = start_of(found(tmp_path / "new", tmp_path / "older"), WALL)
    assert (start.record.number, start.record.stopped, start.stop_reason) == (8, False, "")


def test_an_older_directory_that_a_bridge_uses_is_not_taken_over_and_nothing_is_made(tmp_path: Path) -> None:
    running = StopStore(tmp_path / "older")
    running.open()
    with pytest.raises(StateDirInUse, match="older: another bridge keeps its stop here"):
        found(tmp_path / "new", tmp_path / "older")
    running.close()
    assert not (tmp_path / "new").exists(), "the next bridge looks again"
