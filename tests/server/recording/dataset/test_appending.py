"""Datasets that grow by kept episodes: whole at any moment, whatever ends the process that appends."""

import asyncio
import json
import os
import random
import re
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.server.cli.recordings.follow import append_once
from lockstep.server.recording.dataset import appending
from lockstep.server.recording.dataset.appending import alone_with, read_state
from lockstep.server.recording.dataset.commit import STAGE, commit, recover, stage_of
from lockstep.server.recording.dataset.follower import DatasetFollower
from lockstep.server.recording.episodes.episode_filter import EpisodeFilter
from lockstep.server.recording.errors import DatasetRefused, RecordingDamaged
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.export.lerobot_layout import LayoutChoice
from lockstep.server.recording.format.records import Degraded
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.dataset.growing_file import GrowingFile
from tests.server.recording.makers import EPOCH, INTERVAL, START, own_entry
from tests.server.recording.test_episode_export import KEPT_AND_NOT, OTHER, changed, episode, recording

FILES = 7  # of an append to a dataset with one camera
STEPS = FILES + 1


def events_of(root: Path) -> list[list[int]]:
    """The events of each episode that LeRobot would find: those that the metadata counts."""
    state = read_state(root)
    found: list[list[int]] = [[] for _ in range(state.info["total_episodes"])]
    for row in all_rows(root)[: state.info["total_frames"]]:
        found[row["episode_index"]].append(row["lockstep.event"])
    return found


def all_rows(root: Path) -> list[dict[str, Any]]:
    return [row for path in sorted(root.glob("data/*/*.parquet")) for row in pq.read_table(path).to_pylist()]


def follower(root: Path, said: list[str] | None = None, **options: Any) -> DatasetFollower:
    return DatasetFollower(root, DatasetOptions(**options), (said if said is not None else []).append)


def test_each_kept_episode_is_appended_once_it_is_on_the_disk_and_no_other(tmp_path: Path) -> None:
    file, root = GrowingFile(tmp_path / "a.mcap", KEPT_AND_NOT), tmp_path / "dataset"
    following = follower(root)
    file.write_until(19)
    assert following.look([file.path]) == 0
    assert not root.exists()
    file.write_until(44)
    assert following.look([file.path]) == 1
    assert events_of(root) == [[*range(10, 20)]]
    assert verify_dataset(root).ok
    assert following.look([file.path]) == 0
    file.write_until(100)
    assert following.look([file.path]) == 1
    assert events_of(root) == [[*range(10, 20)], [*range(45, 60)]]
    assert verify_dataset(root).ok
    assert not (root / STAGE).exists()


def test_a_dataset_that_was_appended_to_is_what_an_export_of_all_would_be(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (whole,) = export_lerobot.export(path, tmp_path / "whole", "")
    append_once([path], tmp_path / "grown", DatasetOptions(), print)
    append_once([path], tmp_path / "grown", DatasetOptions(), print)
    assert all_rows(tmp_path / "grown") == all_rows(whole)
    assert read_state(tmp_path / "grown").statistics == read_state(whole).statistics


def test_one_process_at_a_time_appends(tmp_path: Path) -> None:
    with alone_with(tmp_path / "dataset"), pytest.raises(DatasetRefused), alone_with(tmp_path / "dataset"):
        pass


def test_episodes_of_another_robot_or_without_a_camera_are_left_out_and_said_once(tmp_path: Path) -> None:
    said: list[str] = []
    kept = (episode("a", "start", 10, 10), episode("a", "kept", 10, 20))
    path = recording(tmp_path / "a.mcap", *kept, events=30)
    following = follower(tmp_path / "dataset", said, cameras=["back"])
    assert [following.look([path]), following.look([path])] == [0, 0]
    assert said == ["episode a of a.mcap is left out: a.mcap has no pictures of back"]


def test_a_change_before_the_append_counts_and_a_later_one_does_not(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    changed(path, "a", first_event=12)
    changed(path, "c", dropped=True)
    following = follower(tmp_path / "dataset")
    assert following.look([path]) == 1
    assert events_of(tmp_path / "dataset") == [[*range(12, 20)]]
    changed(path, "a", first_event=10)
    changed(path, "a", task="pull")
    said: list[str] = []
    assert append_once([path], tmp_path / "dataset", DatasetOptions(), said.append) == 0
    assert events_of(tmp_path / "dataset") == [[*range(12, 20)]]
    assert read_state(tmp_path / "dataset").tasks == ["push"]
    assert said == [
        "episode a of a.mcap is left out: the dataset has 8 of its 10 events already, as a, from before a change",
        "0 appended, 1 left out",
    ]


def test_a_dataset_takes_the_wanted_episodes_alone_also_when_one_is_relabelled_later(tmp_path: Path) -> None:
    path, root, said = recording(tmp_path / "a.mcap", *KEPT_AND_NOT), tmp_path / "dataset", list[str]()
    changed(path, "a", outcome="failure")
    changed(path, "c", outcome="")
    following = follower(root, said, only=EpisodeFilter(outcomes=["success"]))
    assert [following.look([path]), following.look([path])] == [0, 0]
    assert not root.exists()
    why = [
        f"episode {id} of a.mcap is left out: its outcome is {word}" for id, word in (("a", "failure"), ("c", "none"))
    ]
    assert said == why
    changed(path, "c", outcome="success")
    assert following.look([path]) == 1
    assert events_of(root) == [[*range(45, 60)]]
    assert read_state(root).notes.only == EpisodeFilter(outcomes=["success"])
    changed(path, "a", outcome="success")
    assert append_once([path], root, DatasetOptions(), said.append) == 1, "the dataset keeps what it wants"


def test_an_export_takes_the_wanted_episodes_alone_and_says_where_there_are_none(tmp_path: Path) -> None:
    path, said = recording(tmp_path / "a.mcap", *KEPT_AND_NOT), list[str]()
    by_hand = recording(tmp_path / "b.mcap", info=OTHER)
    options = DatasetOptions(only=EpisodeFilter(tasks=["wipe"]), whole=True)
    (root,) = export_lerobot.export_all([path, by_hand], tmp_path / "dataset", options, say=said.append)
    assert events_of(root) == [[*range(45, 60)]]
    assert verify_dataset(root).ok
    assert said == [
        "episode a of a.mcap is left out: its task is 'push'",
        "b.mcap is left out: it has no episodes to choose from",
    ]
    with pytest.raises(RecordingDamaged, match="there is no kept episode that is wanted"):
        export_lerobot.export_all([path], tmp_path / "none", DatasetOptions(only=EpisodeFilter(drivers=["x"])))
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tolerance": 3}, "a tolerance of 4 and not 3 events"),
        ({"fps": 9}, "each event as a row and not 9 rows a second"),
        ({"cameras": ["back"]}, "the cameras front and not back"),
        (
            {"layout": LayoutChoice(axes=["base.wz", "base.vx"])},
            "axes base.vx.vel, base.wz.vel and not base.wz, base.vx",
        ),
        ({"layout": LayoutChoice(extras=["wrench"])}, "none and not wrench as columns of their own"),
        ({"only": EpisodeFilter(tasks=["push"])}, "all of the kept episodes, and not those"),
    ],
)
def test_a_dataset_refuses_other_options_than_those_that_it_was_made_with(
    tmp_path: Path, options: dict[str, Any], words: str
) -> None:
    path, root = recording(tmp_path / "a.mcap", *KEPT_AND_NOT), tmp_path / "dataset"
    follower(root).look([path])
    names = read_state(root).info["features"]["action"]["names"]
    for same in ({"tolerance": 4}, {"cameras": ["front"]}, {"layout": LayoutChoice(axes=names)}, {}):
        follower(root, **same)
    with pytest.raises(DatasetRefused, match=re.escape(words)):
        follower(root, **options)
    changed(path, "a", dropped=True)
    changed(path, "c", dropped=True)
    follower(root).look([path])
    assert not (root / "meta" / "info.json").exists(), "no episode is left"
    with pytest.raises(DatasetRefused, match="keeps what it was made with"):
        follower(root, **options)


@pytest.mark.parametrize("features", [[], {"action": None}, {"action": {"names": [1]}}, {"action": {"names": {}}}])
def test_metadata_that_somebody_has_damaged_refuses_options_by_name_too(tmp_path: Path, features: object) -> None:
    path, root = recording(tmp_path / "a.mcap", *KEPT_AND_NOT), tmp_path / "dataset"
    follower(root).look([path])
    info = root / "meta" / "info.json"
    info.write_text(json.dumps({**json.loads(info.read_text()), "features": features}))
    with pytest.raises(DatasetRefused, match="and not base.vx"):
        follower(root, layout=LayoutChoice(axes=["base.vx"]))


def test_a_rate_that_was_chosen_is_kept_and_another_one_refused(tmp_path: Path) -> None:
    path, root = recording(tmp_path / "a.mcap", *KEPT_AND_NOT), tmp_path / "dataset"
    follower(root, fps=5).look([path])
    follower(root, fps=5)
    follower(root)
    with pytest.raises(DatasetRefused, match="5 rows a second and not 6"):
        follower(root, fps=6)


def test_a_kept_episode_without_a_row_is_noted_in_the_dataset_also_before_it_begins(tmp_path: Path) -> None:
    """Something was left out at events 8 and 62; keyframes are those of events 2, 52 and 102."""
    lost = [
        own_entry(Degraded(epoch=EPOCH, event=at, lost=1), START + (at - 1) * INTERVAL + 1_000_000) for at in (8, 62)
    ]
    last = (episode("e", "start", 80, 80), episode("e", "kept", 80, 90))
    said: list[str] = []
    file, root = GrowingFile(tmp_path / "a.mcap", [*lost, *KEPT_AND_NOT[:6], *last]), tmp_path / "dataset"
    following = follower(root, said)
    for event, noted in ((44, None), (61, ["a"]), (100, ["a", "e"])):
        file.write_until(event)
        following.look([file.path])
        assert (root.exists() and [each.episode for each in read_state(root).notes.without_rows]) == (noted or False)
    assert [line.partition(":")[0] for line in said] == [
        "episode a of a.mcap is left out",
        "episode c of a.mcap",
        "episode e of a.mcap is left out",
    ]
    assert verify_dataset(root).ok
    assert follower(root).look([file.path]) == 0
    assert [each.episode for each in read_state(root).notes.without_rows] == ["a", "e"]


def has_both(root: Path) -> bool:
    return (root / "meta" / "info.json").exists() and len(events_of(root)) == 2


class Killed(BaseException):
    pass


def killed_after(steps: int) -> Callable[[Path, Path], None]:
    left = [steps]

    def replace(source: Path, target: Path) -> None:
        if left[0] == 0:
            raise Killed
        left[0] -= 1
        os.replace(source, target)

    return replace


@pytest.mark.parametrize("steps", range(STEPS))
def test_an_append_that_is_cut_short_after_any_rename_leaves_whole_episodes_and_is_completed(
    tmp_path: Path, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    root, file = tmp_path / "dataset", GrowingFile(tmp_path / "a.mcap", KEPT_AND_NOT)
    file.write_until(44)
    following = follower(root)
    assert following.look([file.path]) == 1
    file.write_until(100)
    monkeypatch.setattr(appending, "commit", lambda place, files: commit(place, files, killed_after(steps)))
    with pytest.raises(Killed) if steps < FILES else nullcontext():
        following.look([file.path])
    monkeypatch.undo()
    whole = [[*range(10, 20)], [*range(45, 60)]]
    assert events_of(root) == (whole if steps >= FILES else whole[:1])
    with alone_with(root):
        assert events_of(root) == whole
        assert follower(root).look([file.path]) == 0
    assert verify_dataset(root).ok


async def test_a_process_that_is_killed_at_any_moment_leaves_exactly_the_kept_episodes(tmp_path: Path) -> None:
    """Killed 6 times within the second that an append takes; each next run goes on."""
    root, folder = tmp_path / "dataset", tmp_path / "recordings"
    folder.mkdir()
    chance, whole = random.Random(7), {(10, 20), (45, 60)}
    file = GrowingFile(folder / "a.mcap", KEPT_AND_NOT)
    command = (str(LOCKSTEP), "export", "--to", "lerobot", "--follow", "--out", str(root), "--dir", str(folder))
    for run in range(7):
        process = await asyncio.create_subprocess_exec(
            *command, "--state-dir", str(tmp_path / "state"), stdout=asyncio.subprocess.PIPE
        )
        assert process.stdout is not None
        try:
            async with asyncio.timeout(60):
                assert b"follows" in await process.stdout.readline()
                file.write_until(45 if run < 3 else 100)
                if run < 6:
                    await asyncio.sleep(chance.uniform(0.0, 1.2))
                    process.kill()
                else:
                    while not has_both(root):  # noqa: ASYNC110
                        await asyncio.sleep(0.05)
                    process.terminate()
                await process.wait()
        finally:
            with suppress(ProcessLookupError):
                process.kill()
        if (root / "meta" / "info.json").exists():
            found = events_of(root)
            assert {(each[0], each[-1] + 1) for each in found} <= whole
            assert len(found) <= 2
            assert all(len(each) == each[-1] + 1 - each[0] for each in found)
    assert events_of(root) == [[*range(10, 20)], [*range(45, 60)]]
    assert verify_dataset(root).ok
    assert process.returncode == 0


def test_a_stage_without_a_journal_never_happened(tmp_path: Path) -> None:
    root = tmp_path / "dataset"
    (stage_of(root) / "meta").mkdir()
    (root / STAGE / "meta" / "info.json").write_text("{}")
    assert recover(root)
    assert list(root.iterdir()) == []
    assert not recover(root)


def test_a_journal_that_names_a_file_outside_of_the_dataset_moves_nothing(tmp_path: Path) -> None:
    root = tmp_path / "dataset"
    (stage_of(root) / "journal.json").write_text('{"files": ["../../evil"]}')
    recover(root)
    assert list(root.iterdir()) == []
