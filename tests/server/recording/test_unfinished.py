"""What killed exports leave: folders, removed when nobody owns them, and only then; nothing under their own name."""

import importlib
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from lockstep.server.recording.export.unfinished import LOCK, remove_stale, stale_folders, unfinished, unfinished_file
from tests.server.recording.makers import Story

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


STOPS = """
import importlib, sys, time
from pathlib import Path
from lockstep.server.recording.reading.reader import RecordingReader

kind, path, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
chunk = RecordingReader.chunk

def stopping(self, number, topics=None):
    begun = any(each.is_file() for each in out.parent.rglob(out.name))
    if begun and number == len(self.index.chunks) - 1:
        print("half", flush=True)
        time.sleep(1000)
    return chunk(self, number, topics)

RecordingReader.chunk = stopping
importlib.import_module(f"lockstep.server.recording.export.export_{kind}").export(path, out, "")
"""


@pytest.mark.parametrize("kind", ["csv", "parquet", "mp4", "rerun"])
def test_an_export_that_is_killed_leaves_nothing_under_its_name_and_the_next_one_is_whole(
    kind: str, tmp_path: Path
) -> None:
    if kind == "rerun":
        pytest.importorskip("rerun")
    path, folder = tmp_path / "a.mcap", tmp_path / "exports"
    Story(events=60, real=True).write(path)
    target = folder / f"a.{'rrd' if kind == 'rerun' else kind}"
    words = [sys.executable, "-c", STOPS, kind, str(path), str(target)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "half\n"
        process.kill()
    assert [each.suffix for each in folder.iterdir() if not each.name.startswith(".")] == []
    export: Any = importlib.import_module(f"lockstep.server.recording.export.export_{kind}")
    assert export.export(path, target, "") == [target]
    assert list(folder.iterdir()) == [target]


def test_an_export_that_fails_leaves_the_file_that_was_there_before(tmp_path: Path) -> None:
    target = tmp_path / "a.csv"
    target.write_text("before")

    def fails() -> None:
        with unfinished_file(target) as partial:
            partial.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fails()
    assert list(tmp_path.iterdir()) == [target]
    assert target.read_text() == "before"


def test_a_file_by_a_link_is_replaced_where_the_link_leads_and_a_pipe_is_written_itself(tmp_path: Path) -> None:
    link, kept = tmp_path / "link", tmp_path / "elsewhere" / "a.csv"
    link.symlink_to(kept)
    with unfinished_file(link) as partial:
        partial.write_text("1")
        assert not kept.exists()
    assert link.is_symlink()
    assert kept.read_text() == "1"
    with unfinished_file(Path("/dev/null")) as partial:
        assert partial == Path("/dev/null")
