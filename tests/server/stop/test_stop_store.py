import os
import re
from pathlib import Path

import pytest

from lockstep.server.audit.records import Actor
from lockstep.server.stop.stop_presses import Press
from lockstep.server.stop.stop_store import UNREADABLE, KeptStops, kept_stops_place

ANN = Actor("Änn", "operator", "p1", "link")


def _press(name: str, time: float = 0.0) -> Press:
    return Press(id=name, by=ANN, where="http", reason="smoke", time=time)


def _kept(directory: Path, robot: str = "tcp://a:1") -> KeptStops:
    return KeptStops(kept_stops_place(directory, robot))


def test_what_is_kept_is_found_by_the_next_run_oldest_first_until_it_is_dropped(tmp_path: Path) -> None:
    kept = _kept(tmp_path)
    assert kept.load() == []
    for press in (_press("late", 2.0), _press("early", 1.0)):
        kept.keep(press)
    assert _kept(tmp_path).load() == [_press("early", 1.0), _press("late", 2.0)]
    kept.drop("early")
    kept.drop("early")
    assert _kept(tmp_path).load() == [_press("late", 2.0)]


def test_stops_of_another_robot_are_not_found(tmp_path: Path) -> None:
    _kept(tmp_path).keep(_press("mine"))
    assert _kept(tmp_path, "tcp://b:1").load() == []


@pytest.mark.parametrize("name", ["../../etc/passwd", "a/b", ".", "x" * 64, "\N{SNOWMAN}", "con\x00"])
def test_a_press_id_of_any_text_names_a_file_of_this_directory(tmp_path: Path, name: str) -> None:
    kept = _kept(tmp_path)
    kept.keep(_press(name))
    assert [press.id for press in kept.load()] == [name]
    assert len(list((tmp_path / "kept-stops").rglob("*.json"))) == 1
    assert [each.name for each in tmp_path.iterdir()] == ["kept-stops"]
    kept.drop(name)
    assert kept.load() == []


@pytest.mark.parametrize(
    "damage", [b"", b"{", b"\xff\xff", b"[]", b'{"id": "another"}', b"{" * 100_000, b'{"x":' + b"[" * 16_000]
)
def test_a_file_that_cannot_be_read_is_a_stop_too_and_goes_when_that_has_arrived(tmp_path: Path, damage: bytes) -> None:
    kept = _kept(tmp_path)
    kept.keep(_press("a"))
    (path,) = (tmp_path / "kept-stops").rglob("*.json")
    path.write_bytes(damage)
    (found,) = kept.load()
    assert found.reason == UNREADABLE
    (again,) = kept.load()
    kept.drop(again.id)
    assert kept.load() == []


def test_a_file_of_an_id_that_no_message_can_hold_or_of_any_name_is_a_stop_that_can_be_sent(tmp_path: Path) -> None:
    kept = _kept(tmp_path)
    kept.keep(_press("x" * 65))
    place = kept_stops_place(tmp_path, "tcp://a:1")
    (place / f"{'y' * 200}.json").write_text("{}")
    found = kept.load()
    assert all(re.fullmatch("[0-9a-f]{32}", press.id) for press in found)
    for press in found:
        kept.drop(press.id)
    assert (len(found), kept.load()) == (2, [])


def test_a_file_that_can_neither_be_read_nor_moved_hides_no_other_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = _kept(tmp_path)
    kept.keep(_press("a"))
    (path,) = (tmp_path / "kept-stops").rglob("*.json")
    path.write_bytes(b"{")
    kept.keep(_press("b", 1.0))

    def refuse(*args: object) -> None:
        raise OSError("read-only")

    monkeypatch.setattr(os, "replace", refuse)
    assert [press.reason for press in kept.load()] == [UNREADABLE, "smoke"]


def test_a_file_that_was_half_written_is_not_taken_for_a_stop(tmp_path: Path) -> None:
    kept = _kept(tmp_path)
    kept.keep(_press("a"))
    (path,) = (tmp_path / "kept-stops").rglob("*.json")
    path.with_suffix(".new").write_bytes(b"{")
    assert [press.id for press in kept.load()] == ["a"]


def test_each_stop_and_its_directory_are_synced_before_it_counts_as_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[str] = []
    sync = os.fsync

    def note(handle: int) -> None:
        synced.append(Path(os.readlink(f"/proc/self/fd/{handle}")).suffix or "directory")
        sync(handle)

    monkeypatch.setattr(os, "fsync", note)
    _kept(tmp_path).keep(_press("a"))
    assert synced == [".new", "directory", "directory"]


def test_a_disk_that_does_not_take_it_raises(tmp_path: Path) -> None:
    (tmp_path / "kept-stops").write_text("in the way")
    with pytest.raises(OSError, match="kept-stops"):
        _kept(tmp_path).keep(_press("a"))
