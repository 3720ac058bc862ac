"""Episodes that are discarded after they were appended: their rows and pictures leave the dataset, and no others."""

import asyncio
import os
import random
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lockstep.bench.episodes.small_disk import small_disk
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.server.cli.recordings.follow import append_once
from lockstep.server.recording.dataset import exchange
from lockstep.server.recording.dataset.appending import alone_with, is_dataset, read_state
from lockstep.server.recording.errors import DatasetRefused
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.report.dataset_page import dataset_page
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.dataset.growing_file import GrowingFile
from tests.server.recording.dataset.test_appending import all_rows, events_of, follower
from tests.server.recording.episodes.test_edited_datasets import NEXT, change
from tests.server.recording.graders import PASSED, doctor_findings
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording

A, C, F = [*range(10, 20)], [*range(45, 60)], [*range(70, 90)]
RECORDS = (*KEPT_AND_NOT[:6], *NEXT)


def grown(tmp_path: Path) -> tuple[Path, Path]:
    """A recording and a dataset of its three episodes, each in a file of its own."""
    file, root = GrowingFile(tmp_path / "a.mcap", RECORDS), tmp_path / "dataset"
    following = follower(root)
    for event in (44, 65, 100):
        file.write_until(event)
        assert following.look([file.path]) == 1
    assert events_of(root) == [A, C, F]
    return file.path, root


def in_one_file(tmp_path: Path) -> tuple[Path, Path]:
    path = recording(tmp_path / "a.mcap", *RECORDS)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    return path, root


def appended(path: Path, root: Path) -> list[str]:
    said: list[str] = []
    append_once([path], root, DatasetOptions(), said.append)
    return said


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def beside(root: Path) -> list[str]:
    return sorted(each.name for each in root.parent.iterdir() if each.name.startswith(f".{root.name}.partial"))


@pytest.mark.parametrize("made", [grown, in_one_file])
@pytest.mark.parametrize(
    ("discarded", "left"),
    [(["a"], [C, F]), (["c"], [A, F]), (["f"], [A, C]), (["a", "f"], [C])],
)
def test_what_is_left_is_what_an_export_without_the_episode_would_be(
    tmp_path: Path, made: Any, discarded: list[str], left: list[list[int]]
) -> None:
    path, root = made(tmp_path)
    (root / "README.md").write_text("mine")
    change(path, *({"episode": each, "dropped": True} for each in discarded))
    said = appended(path, root)
    assert said[0] == f"episode {discarded[0]} of a.mcap was discarded, and is taken out of dataset, which has 2 left"
    assert said[-1] == "0 appended, 0 left out"
    assert events_of(root) == left
    assert (root / "README.md").read_text() == "mine"
    verdict = verify_dataset(root, pixels=True, recordings=tmp_path)
    assert verdict.ok, verdict
    (new,) = export_lerobot.export(path, tmp_path / "new", "")
    assert all_rows(root) == all_rows(new)
    assert read_state(root).tasks == read_state(new).tasks
    assert read_state(root).notes.episodes == read_state(new).notes.episodes
    assert read_state(root).notes.drivers == read_state(new).notes.drivers
    ours, theirs = read_state(root).statistics, read_state(new).statistics
    for name, numbers in theirs.items():
        for kind, value in numbers.items():
            assert np.allclose(ours[name][kind], value), (name, kind)
    assert dataset_page(root).count("<h2") == dataset_page(new).count("<h2")
    assert not beside(root)


def test_graders_that_others_wrote_find_nothing_after_a_removal(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    change(path, {"episode": "c", "dropped": True})
    appended(path, root)
    assert doctor_findings(root) == (PASSED, [])


@pytest.mark.parametrize("made", [grown, in_one_file])
def test_the_dataset_grows_on_and_an_episode_that_is_put_back_comes_last(tmp_path: Path, made: Any) -> None:
    path, root = made(tmp_path)
    change(path, {"episode": "a", "dropped": True})
    appended(path, root)
    change(path, {"episode": "a", "dropped": False})
    assert appended(path, root)[-1] == "1 appended, 0 left out"
    assert events_of(root) == [C, F, A]
    assert verify_dataset(root, pixels=True, recordings=tmp_path).ok


def test_a_file_that_is_left_keeps_its_name_and_no_other_takes_one_that_is_gone(tmp_path: Path) -> None:
    """A program that has read before which file an episode is in finds it there, or nothing."""
    path, root = grown(tmp_path)
    before = files_of(root / "videos")
    change(path, {"episode": "c", "dropped": True})
    appended(path, root)
    gone = "observation.images.front/chunk-000/file-001.mp4"
    assert files_of(root / "videos") == {name: data for name, data in before.items() if name != gone}
    change(path, {"episode": "c", "dropped": False})
    appended(path, root)
    assert gone not in files_of(root / "videos")
    assert read_state(root).notes.gone == [1]


def test_of_an_episode_of_which_a_part_is_discarded_the_other_part_stays(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    change(path, {"episode": "c", "split": 50}, {"episode": "edit-1a", "dropped": True})
    said = appended(path, root)
    assert said[0] == "episode edit-1a of a.mcap was discarded, and is taken out of dataset, which has 2 left"
    assert events_of(root) == [A, F, [*range(50, 60)]]
    assert verify_dataset(root, pixels=True, recordings=tmp_path).ok


def test_a_merged_episode_that_is_discarded_takes_both_out(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    change(path, {"episode": "c", "merge": "f"}, {"episode": "edit-1", "dropped": True})
    appended(path, root)
    assert events_of(root) == [A]


@pytest.mark.parametrize("made", [grown, in_one_file])
def test_when_all_are_discarded_there_is_no_dataset_and_the_next_kept_one_begins_it_anew(
    tmp_path: Path, made: Any
) -> None:
    path, root = made(tmp_path)
    change(path, *({"episode": each, "dropped": True} for each in "acf"))
    said = appended(path, root)
    assert said[2] == "episode f of a.mcap was discarded, and is taken out of dataset, which has 0 left"
    assert not root.exists()
    assert not beside(root)
    change(path, {"episode": "c", "dropped": False})
    appended(path, root)
    assert events_of(root) == [C]
    assert verify_dataset(root).ok


def test_a_follower_takes_it_out_though_the_recording_does_not_grow_any_more(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *RECORDS), tmp_path / "dataset"
    said: list[str] = []
    following = follower(root, said)
    assert following.look([path]) == 3
    said.clear()
    change(path, {"episode": "a", "dropped": True})
    assert [following.look([path]), following.look([path])] == [0, 0]
    assert said == ["episode a of a.mcap was discarded, and is taken out of dataset, which has 2 left"]
    assert events_of(root) == [C, F]


def test_a_dataset_behind_a_link_is_changed_where_it_is(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    (tmp_path / "link").symlink_to(root)
    change(path, {"episode": "c", "dropped": True})
    appended(path, tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert events_of(root) == [A, F]


def test_where_folders_cannot_be_exchanged_it_stays_and_is_named_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, root = grown(tmp_path)
    before, said = files_of(root), list[str]()

    def refuse(one: Path, other: Path) -> None:
        raise DatasetRefused("planted")

    monkeypatch.setattr(exchange, "_exchange", refuse)
    change(path, {"episode": "c", "dropped": True})
    following = follower(root, said)
    change(path, {"episode": "f", "task": "pull"})
    following.look([path])
    following.look([path])
    assert [each for each in said if "stays" in each] == [
        "episode c of a.mcap was discarded, and stays in dataset: planted"
    ]
    assert files_of(root) == before
    assert not beside(root)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a small disk")
def test_on_a_full_disk_the_dataset_is_as_it_was_and_the_episode_leaves_it_when_there_is_room(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    with small_disk(tmp_path / "disk", 4 << 20):
        path, made = in_one_file(tmp_path)
        root = shutil.copytree(made, tmp_path / "disk" / "dataset")
        before, said = files_of(root), list[str]()
        following = follower(root, said)
        ballast = tmp_path / "disk" / "ballast"
        ballast.write_bytes(bytes(shutil.disk_usage(ballast.parent).free))
        change(path, {"episode": "c", "dropped": True})
        for _ in range(2):
            following.look([path])
            assert "cannot be written, and is tried again" in said[-1]
            assert files_of(root) == before
            assert not beside(root)
        ballast.unlink()
        following.look([path])
        assert events_of(root) == [A, F]
        assert verify_dataset(root).ok


async def test_a_process_that_is_killed_at_any_moment_leaves_the_dataset_before_or_after(tmp_path: Path) -> None:
    root, folder = tmp_path / "dataset", tmp_path / "recordings"
    folder.mkdir()
    path = recording(folder / "a.mcap", *RECORDS)
    chance, without = random.Random(5), False
    export_lerobot.export(path, root, "")
    command = (str(LOCKSTEP), "export", str(path), "--to", "lerobot", "--follow", "--out", str(root))
    for _ in range(7):
        process = await asyncio.create_subprocess_exec(
            *command, "--state-dir", str(tmp_path / "state"), stdout=asyncio.subprocess.PIPE
        )
        assert process.stdout is not None
        try:
            async with asyncio.timeout(60):
                assert b"follows" in await process.stdout.readline()
                without = not without
                change(path, {"episode": "c", "dropped": without})
                await asyncio.sleep(chance.uniform(0.2, 1.2))
                process.kill()
                await process.wait()
        finally:
            with suppress(ProcessLookupError):
                process.kill()
        assert sorted(events_of(root)) in ([A, F], [A, C, F])
    with alone_with(root):
        assert not beside(root)
        follower(root).look([path])
    assert sorted(events_of(root)) == ([A, F] if without else [A, C, F])
    assert verify_dataset(root).ok
    assert is_dataset(root)
