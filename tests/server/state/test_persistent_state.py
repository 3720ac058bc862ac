"""Which state directory a console gets, and whether what is in it outlives the console."""

import tempfile
from pathlib import Path

import pytest

from lockstep.server.settings import Settings
from lockstep.server.state import persistent_state
from lockstep.server.state.persistent_state import open_state


def test_a_directory_of_its_own_on_a_disk_lasts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(persistent_state, "is_in_memory", lambda directory: False)
    assert open_state(Settings(state_dir=tmp_path)).lasts


def test_one_in_memory_does_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(persistent_state, "is_in_memory", lambda directory: directory == tmp_path)
    assert not open_state(Settings(state_dir=tmp_path)).lasts


def test_one_that_stands_in_for_another_does_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "mkdtemp", lambda prefix: str(tmp_path / "new"))
    (tmp_path / "file").write_text("in the way")
    opened = open_state(Settings(state_dir=tmp_path / "file"), fall_back=True)
    assert (opened.directory.path, opened.lasts) == (tmp_path / "new", False)
