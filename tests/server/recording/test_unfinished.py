"""The folders that killed exports leave: removed when nobody owns them, and only then."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lockstep.server.recording.export.unfinished import LOCK, remove_stale, stale_folders, unfinished

EXPORTS = """
import sys, time
from pathlib import Path
from lockstep.server.recording.export.unfinished import unfinished
with unfinished(Path(sys.argv[1])) as partial:
    partial.mkdir()
    (partial / "half").write_text("half")
    print(partial.parent, flush=True)
    time.sleep(1000)
"""


@contextmanager
def exporting(target: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A process that exports without end, and its folder."""
    words = [sys.executable, "-c", EXPORTS, str(target)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process, Path(process.stdout.readline().strip())
        finally:
            process.kill()


def test_the_next_export_of_the_name_removes_what_a_killed_one_left_and_nothing_of_one_that_runs(
    tmp_path: Path,
) -> None:
    target = tmp_path / "data"
    with exporting(target) as (running, running_folder), exporting(target) as (killed, killed_folder):
        killed.send_signal(signal.SIGKILL)
        killed.wait()
        assert stale_folders(tmp_path) == [killed_folder]
        foreign = tmp_path / ".data.partial-0123"
        foreign.mkdir()
        with unfinished(tmp_path / "other") as partial:
            partial.mkdir()
        assert killed_folder.is_dir()  # it is of another name
        with unfinished(target) as partial:
            assert not killed_folder.exists()
            assert running_folder.is_dir()
            assert running.poll() is None
            partial.mkdir()
            (partial / "whole").touch()
    assert [each.name for each in target.iterdir()] == ["whole"]
    assert remove_stale(tmp_path) == [running_folder]
    assert {each.name for each in tmp_path.iterdir()} == {"data", "other", foreign.name}


def test_an_export_that_fails_leaves_nothing(tmp_path: Path) -> None:
    def fails() -> None:
        with unfinished(tmp_path / "data") as partial:
            partial.mkdir()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fails()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_a_link_or_whose_lock_is_one_is_left_alone(tmp_path: Path) -> None:
    elsewhere, linked = tmp_path / "elsewhere", tmp_path / ".a.partial-1"
    elsewhere.mkdir()
    (elsewhere / LOCK).touch()
    (tmp_path / ".b.partial-1").symlink_to(elsewhere)
    linked.mkdir()
    (linked / LOCK).symlink_to(elsewhere / LOCK)
    (tmp_path / ".c.partial-1" / LOCK).mkdir(parents=True)  # nor is this one of ours
    assert remove_stale(tmp_path) == []
