"""The file of changes: lines are only added, by one at a time, and nothing leads out of the directory."""

import os
import threading
from pathlib import Path

import pytest

from lockstep.server.recording.episodes import edits
from lockstep.server.recording.episodes.edits import (
    EpisodeEdit,
    EpisodeEditRefused,
    EpisodeEditStale,
    add_edit,
    edits_path,
    read_edits,
)
from tests.server.recording.episodes.test_edit_rules import RECORDED, edit


def test_a_change_is_added_and_no_earlier_line_changes(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    add_edit(path, RECORDED, edit("a", task="pull"))
    before = edits_path(path).read_bytes()
    add_edit(path, RECORDED, edit("a", split=15), after=1)
    assert edits_path(path).read_bytes().startswith(before)
    assert read_edits(path) == [edit("a", task="pull"), edit("a", split=15)]


def test_a_change_that_was_made_after_an_older_state_is_stale_and_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    add_edit(path, RECORDED, edit("a", task="pull"), after=0)
    for after in (0, 2):
        with pytest.raises(EpisodeEditStale):
            add_edit(path, RECORDED, edit("b", task="wipe"), after=after)
    assert len(read_edits(path)) == 1


def test_a_line_that_a_crash_has_cut_keeps_its_number(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    add_edit(path, RECORDED, edit("a", task="pull"))
    with edits_path(path).open("ab") as file:
        file.write(b'{"episode":"a","at":1.0,"ta')
    found = add_edit(path, RECORDED, edit("a", split=15), after=2)
    assert [each.entry.id for each in found.episodes[:2]] == ["edit-3a", "edit-3b"]
    assert read_edits(path)[1] is None


def test_an_undo_is_refused_while_a_later_change_builds_on_it(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for change in (edit("a", split=15), edit("edit-1a", task="x")):
        add_edit(path, RECORDED, change)
    with pytest.raises(EpisodeEditRefused, match="builds on"):
        add_edit(path, RECORDED, edit(undo=1))
    add_edit(path, RECORDED, edit(undo=2))
    found = add_edit(path, RECORDED, edit(undo=1))
    assert [each.entry for each in found.episodes] == RECORDED


def test_of_many_who_change_the_same_state_at_once_one_wins(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    won: list[int] = []
    start = threading.Barrier(8)

    def change(number: int) -> None:
        start.wait()
        try:
            add_edit(path, RECORDED, edit("a", task=f"by {number}"), after=0)
            won.append(number)
        except EpisodeEditStale:
            pass

    threads = [threading.Thread(target=change, args=(number,)) for number in range(8)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert [each and each.task for each in read_edits(path)] == [f"by {number}" for number in won]
    assert len(won) == 1


REFUSED = "symbolic|regular|directory|No such device"


@pytest.mark.parametrize("kind", ["link", "pipe", "directory"])
def test_what_is_no_regular_file_is_neither_read_nor_written(tmp_path: Path, kind: str) -> None:
    path, elsewhere = tmp_path / "a.mcap", tmp_path / "elsewhere"
    elsewhere.write_text("{}\n")
    target = edits_path(path)
    if kind == "link":
        target.symlink_to(elsewhere)
    elif kind == "pipe":
        os.mkfifo(target)
    else:
        target.mkdir()
    with pytest.raises(OSError, match=REFUSED):
        read_edits(path)
    with pytest.raises(OSError, match=REFUSED):
        add_edit(path, RECORDED, edit("a", task="pull"))
    assert elsewhere.read_text() == "{}\n"


def test_the_number_of_changes_and_their_bytes_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mcap"
    monkeypatch.setattr(edits, "MAX_EDITS", 3)
    for _ in range(3):
        add_edit(path, RECORDED, edit("a", task="pull"))
    with pytest.raises(EpisodeEditRefused, match="no room"):
        add_edit(path, RECORDED, edit("a", task="pull"))
    monkeypatch.setattr(edits, "MAX_EDITS", 10)
    monkeypatch.setattr(edits, "MAX_BYTES", edits_path(path).stat().st_size)
    with pytest.raises(EpisodeEditRefused, match="no room"):
        add_edit(path, RECORDED, EpisodeEdit(episode="a", at=1.0, task="x" * 300))
