"""Episodes that are discarded after they were appended: their rows and pictures leave the dataset, and no others."""

import asyncio
import errno
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
from lockstep.server.recording.dataset import follower as follower_module
from lockstep.server.recording.dataset.appending import alone_with, is_dataset, read_state
from lockstep.server.recording.dataset.commit import sync
from lockstep.server.recording.errors import DatasetRefused, RecordingDamaged
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.format.records import Degraded
from lockstep.server.recording.report.dataset_page import dataset_page
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.dataset.growing_file import GrowingFile
from tests.server.recording.dataset.test_appending import Killed, all_rows, events_of, follower
from tests.server.recording.episodes.test_edited_datasets import NEXT, change
from tests.server.recording.graders import PASSED, doctor_findings
from tests.server.recording.makers import EPOCH, INTERVAL, START, own_entry
from tests.server.recording.test_episode_export import KEPT_AND_NOT, episode, recording

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


def killed(*_: object) -> None:
    raise Killed


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
    names, count = ", ".join(discarded), len(left)
    assert said[0] == f"episode {names}: discarded since, and taken out of dataset, which has {count} left"
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
    assert said[0] == "episode c: discarded since, and taken out of dataset, which has 2 left"
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
    assert said[0] == "episode a, c, f: discarded since, and taken out of dataset, which has 0 left"
    assert not is_dataset(root)
    assert list(files_of(root)) == ["meta/lockstep.json"]
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
    assert said == ["episode a: discarded since, and taken out of dataset, which has 2 left"]
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
    assert [each for each in said if "stays" in each] == ["what dataset has of discarded episodes stays: planted"]
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
            assert said[-1].startswith("what dataset has of discarded episodes is tried again: ")
            assert files_of(root) == before
            assert not beside(root)
        assert sum("tried again" in each for each in said) == 1
        ballast.unlink()
        following.look([path])
        assert events_of(root) == [A, F]
        assert verify_dataset(root).ok


def test_beside_an_episode_that_was_discarded_a_full_disk_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    later = episode("g", "start", 91, 91), episode("g", "kept", 91, 95, outcome="success")
    file, said = GrowingFile(tmp_path / "a.mcap", (*RECORDS, *later)), list[str]()
    following = follower(tmp_path / "dataset", said)
    file.write_until(90)
    following.look([file.path])
    change(file.path, {"episode": "c", "dropped": True})
    following.look([file.path])

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("lockstep.server.recording.dataset.follower.append", full)
    said.clear()
    for event in (96, 97, 98):
        file.write_until(event)
        following.look([file.path])
    file.write_until(100)
    assert said == ["dataset cannot be written, and is tried again: [Errno 28] No space left on device"]


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


def test_a_kept_part_is_appended_though_the_follower_has_looked_between_the_changes(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    following = follower(root)
    changes: list[dict[str, Any]] = [{"episode": "c", "split": 50}, {"episode": "edit-1a", "dropped": True}]
    for one in changes:
        change(path, one)
        following.look([path])
    assert events_of(root) == [A, F, [*range(50, 60)]]


def test_an_episode_that_was_changed_and_discarded_comes_in_as_it_is_when_it_is_put_back(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    following = follower(root)
    changes: list[dict[str, Any]] = [{"first_event": 50}, {"dropped": True}, {"dropped": False}]
    for one in changes:
        change(path, {"episode": "c", **one})
        following.look([path])
    assert events_of(root) == [A, F, [*range(50, 60)]]


@pytest.mark.parametrize("restarted", [False, True])
def test_a_kept_part_of_an_old_episode_is_appended_by_a_follower_that_takes_new_ones(
    tmp_path: Path, restarted: bool
) -> None:
    path, root = grown(tmp_path)
    late, following = 2**60, follower(root)
    change(path, {"episode": "c", "split": 50}, {"episode": "edit-1a", "dropped": True})
    if restarted:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(follower_module, "append", killed)
            with pytest.raises(Killed):
                following.look([path], since=late)
        following = follower(root)
    following.look([path], since=late)
    assert events_of(root) == [A, F, [*range(50, 60)]]


def test_a_discarded_episode_leaves_though_it_was_trimmed_to_other_events_since(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *RECORDS), tmp_path / "dataset"
    change(path, {"episode": "c", "first_event": 55})
    appended(path, root)
    change(path, {"episode": "c", "first_event": 45, "last_event": 52}, {"episode": "c", "dropped": True})
    appended(path, root)
    assert events_of(root) == [A, F]


def test_a_discarded_episode_without_rows_is_noted_no_more(tmp_path: Path) -> None:
    lost = own_entry(Degraded(epoch=EPOCH, event=62, lost=1), START + 61 * INTERVAL + 1_000_000)
    path, root = recording(tmp_path / "a.mcap", lost, *RECORDS), tmp_path / "dataset"
    appended(path, root)
    assert [each.episode for each in read_state(root).notes.without_rows] == ["f"]
    change(path, {"episode": "f", "dropped": True})
    appended(path, root)
    assert read_state(root).notes.without_rows == []


def test_what_others_have_put_into_the_folder_stays_when_the_last_episode_goes(tmp_path: Path) -> None:
    root = tmp_path / "dataset"
    (root / "recordings").mkdir(parents=True)
    (root / "README.md").write_text("mine")
    path = recording(root / "recordings" / "a.mcap", *RECORDS)
    appended(path, root)
    change(path, *({"episode": each, "dropped": True} for each in "acf"))
    appended(path, root)
    assert sorted(files_of(root)) == [
        "README.md",
        "meta/lockstep.json",
        "recordings/a.episodes.jsonl",
        "recordings/a.mcap",
    ]


def test_a_dataset_that_begins_anew_has_the_options_of_the_one_before(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *RECORDS[2:4], *NEXT), tmp_path / "dataset"
    append_once([path], root, DatasetOptions(fps=10, tolerance=2), lambda _: None)
    change(path, {"episode": "f", "split": 80}, {"episode": "edit-1a", "dropped": True})
    appended(path, root)
    state = read_state(root)
    assert (state.fps, state.notes.has_rate, state.notes.tolerance) == (10, True, 2)


def test_files_of_a_dataset_that_lost_its_info_are_not_mixed_with_those_of_another(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    (root / "meta" / "info.json").unlink()
    before = files_of(root)
    with pytest.raises(RecordingDamaged, match=r"no meta/info.json"):
        appended(path, root)
    assert files_of(root) == before


@pytest.mark.parametrize("restarted", [False, True])
def test_the_only_episode_comes_in_again_when_it_is_put_back_however_old_it_is(tmp_path: Path, restarted: bool) -> None:
    path, root = recording(tmp_path / "a.mcap", *RECORDS[2:6]), tmp_path / "dataset"
    append_once([path], root, DatasetOptions(fps=10), lambda _: None)
    following = follower(root)
    for dropped in (True, False):
        change(path, {"episode": "c", "dropped": dropped})
        following.look([path], since=2**60)
        following = follower(root) if restarted else following
    assert {row["lockstep.event"] for row in all_rows(root)} <= set(C)
    assert verify_dataset(root).ok
    assert read_state(root).fps == 10


def test_changes_of_one_name_in_two_copies_of_a_recording_are_two(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *RECORDS), tmp_path / "dataset"
    copy = Path(shutil.copy(path, tmp_path / "b.mcap"))
    change(path, {"episode": "c", "split": 50})
    appended(path, root)
    change(copy, {"episode": "f", "split": 80}, {"episode": "edit-1a", "dropped": True})
    for paths in ([path, copy], [copy, path]):
        append_once(paths, root, DatasetOptions(), lambda _: None)
        events = {event for each in events_of(root) for event in each}
        assert events >= {*A, *C}, "the first part of c is kept, whatever became of that of f"
        assert not events & {*range(70, 80)}


def test_an_episode_that_was_trimmed_to_other_events_and_discarded_comes_in_when_it_is_put_back(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *RECORDS), tmp_path / "dataset"
    change(path, {"episode": "c", "first_event": 55})
    following = follower(root)
    following.look([path])
    changes: list[dict[str, Any]] = [{"first_event": 45, "last_event": 52}, {"dropped": True}, {"dropped": False}]
    for one in changes:
        change(path, {"episode": "c", **one})
        following.look([path], since=2**60)
    assert events_of(root) == [A, F, [*range(45, 52)]]


def test_a_copy_without_the_changes_brings_no_discarded_episode_back(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    copy = Path(shutil.copy(path, tmp_path / "b.mcap"))
    change(path, {"episode": "c", "dropped": True})
    for _ in range(2):
        said: list[str] = []
        append_once([copy, path], root, DatasetOptions(), said.append)
        assert events_of(root) == [A, F]
    assert "episode c of b.mcap is left out: it was discarded, in another copy of the recording" in said


def test_a_recording_that_says_itself_that_an_episode_was_discarded_takes_nothing_out(tmp_path: Path) -> None:
    """Such a one never came into a dataset: this record is of another recording, whatever it says."""
    _, root = grown(tmp_path)
    other = (episode("x", "start", 1, 1), episode("x", "discarded", 1, 100))
    appended(recording(tmp_path / "z.mcap", *other), root)
    assert events_of(root) == [A, C, F]


@pytest.mark.parametrize("name", ["data", "meta", "videos"])
def test_a_dataset_that_is_partly_elsewhere_stays_as_it_is(tmp_path: Path, name: str) -> None:
    path, root = grown(tmp_path)
    (root / name).rename(tmp_path / "elsewhere")
    (root / name).symlink_to(tmp_path / "elsewhere")
    before = files_of(tmp_path / "elsewhere")
    change(path, {"episode": "c", "dropped": True})
    assert "stays: " in appended(path, root)[0]
    assert files_of(tmp_path / "elsewhere") == before


@pytest.mark.parametrize("damage", ["shorter", "missing"])
def test_a_damaged_dataset_stays_as_it_is_and_is_named_once(tmp_path: Path, damage: str) -> None:
    path, root = in_one_file(tmp_path)
    (video,) = root.rglob("*.mp4")
    if damage == "missing":
        video.unlink()
    else:
        video.write_bytes(video.read_bytes()[:2000])
    change(path, {"episode": "c", "dropped": True})
    said: list[str] = []
    following = follower(root, said)
    for _ in range(2):
        following.look([path])
    assert len(said) == 1
    assert "stays: " in said[0]
    assert not beside(root)


def test_after_an_error_behind_the_exchange_the_dataset_grows_on_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, root = in_one_file(tmp_path)
    following = follower(root)

    def fail(where: Path) -> None:
        if where == tmp_path:
            raise OSError(5, "planted")
        sync(where)

    monkeypatch.setattr("lockstep.server.recording.dataset.exchange.sync", fail)
    change(path, {"episode": "c", "dropped": True})
    following.look([path])
    monkeypatch.undo()
    change(path, {"episode": "c", "dropped": False})
    following.look([path])
    assert events_of(root) == [A, F, C]
    assert verify_dataset(root, pixels=True).ok


def test_folders_keep_their_modes_and_owners_and_files_that_are_no_files_stay(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    (root / "data").chmod(0o2775)
    (root / "empty").mkdir()
    os.mkfifo(root / "fifo")
    if os.geteuid() == 0:
        os.chown(root / "data", 1234, 1234)
    before = (root / "data").stat()
    change(path, {"episode": "c", "dropped": True})
    appended(path, root)
    after = (root / "data").stat()
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    assert (root / "empty").is_dir()
    assert (root / "fifo").is_fifo()


def test_one_process_at_a_time_changes_a_dataset_also_behind_a_link(tmp_path: Path) -> None:
    _, root = grown(tmp_path)
    (tmp_path / "link").symlink_to(root)
    with alone_with(root), pytest.raises(DatasetRefused), alone_with(tmp_path / "link"):
        pass


def test_a_file_that_the_dataset_does_not_say_is_found(tmp_path: Path) -> None:
    _, root = grown(tmp_path)
    shutil.copy(root / "data/chunk-000/file-000.parquet", root / "data/chunk-000/file-009.parquet")
    assert verify_dataset(root).checks["counted"].violations[0].text.startswith("data/chunk-000/file-009.parquet")


def test_a_dataset_behind_a_link_begins_anew_there_when_all_were_discarded_and_one_is_put_back(tmp_path: Path) -> None:
    path, root = grown(tmp_path)
    link = tmp_path / "link"
    link.symlink_to(root)
    change(path, *({"episode": each, "dropped": True} for each in "acf"))
    appended(path, link)
    change(path, {"episode": "c", "dropped": False})
    appended(path, link)
    assert events_of(link) == [C]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a small disk")
@pytest.mark.parametrize("where", [".", "mine"])
def test_a_dataset_that_is_a_mount_or_has_one_stays_as_it_is(tmp_path: Path, where: str) -> None:
    path, made = grown(tmp_path)
    root = tmp_path / "copy"
    (root / where).mkdir(parents=True)
    with small_disk(root / where, 4 << 20):
        shutil.copytree(made, root, dirs_exist_ok=True)
        before = files_of(root)
        change(path, {"episode": "c", "dropped": True})
        assert "stays: " in appended(path, root)[0]
        change(path, *({"episode": each, "dropped": True} for each in "af"))
        assert "stays: " in appended(path, root)[0]
        assert files_of(root) == before
        assert not beside(root)
