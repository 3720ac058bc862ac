"""Datasets of real sessions: LeRobot loads, merges and trains on them, and their pictures are of their rows."""

import asyncio
import json
import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from lockstep.client import Console
from lockstep.server.cli.recordings.follow import append_once
from lockstep.server.recording.dataset import appending
from lockstep.server.recording.dataset.commit import commit
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.export.lerobot_layout import LayoutChoice
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.lerobot.commands import ROOT, environment, lerobot_python, run_lerobot
from tests.lerobot.sessions import PATIENCE, drive, following, recorded_stack, so101_joints, so101_tool
from tests.server.recording.dataset.growing_file import GrowingFile
from tests.server.recording.dataset.test_appending import FILES, Killed, follower, killed_after
from tests.server.recording.episodes.test_edited_datasets import change
from tests.server.recording.test_episode_export import KEPT_AND_NOT

pytestmark = [pytest.mark.long, pytest.mark.timeout(2400)]

JOINTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
FPS = 10
SECONDS = 4.0
TOLERANCE = 4
CAMERAS = ["observation.images.overview", "observation.images.arm.gripper"]
SMALL_ACT = (
    *("--policy.type=act", "--policy.device=cpu", "--policy.push_to_hub=false"),
    "--policy.pretrained_backbone_weights=null",
    *("--policy.chunk_size=5", "--policy.n_action_steps=5", "--policy.dim_model=64", "--policy.n_heads=4"),
    *("--policy.dim_feedforward=64", "--policy.n_encoder_layers=1", "--policy.n_vae_encoder_layers=1"),
    *("--dataset.video_backend=pyav", "--dataset.use_imagenet_stats=false", "--steps=3", "--batch_size=2"),
    *("--num_workers=0", "--log_freq=1", "--save_checkpoint=false", "--eval_freq=0", "--wandb.enable=false"),
)


@dataclass
class Session:
    """A session of the SO-101: two kept episodes, one that was discarded and one that was redone.

    Attributes:
        grown: the dataset that was appended to meanwhile
        kept: the ids of the kept episodes
    """

    recordings: list[Path]
    grown: Path
    kept: list[str]


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    folder = tmp_path_factory.mktemp("so101")
    recordings, grown, kept = folder / "recordings", folder / "grown", []
    async with (
        recorded_stack(folder, "so101", recordings) as stack,
        following(folder, recordings, grown, "--fps", str(FPS)) as said,
    ):
        async with Console(stack.operator, video=False, audio=False, name="Ada") as console:
            await console.take_seat()
            kept.append(await console.episodes.start("swing the arm"))
            await drive(console, so101_joints, SECONDS)
            await console.episodes.success()
            await console.episodes.start("swing the arm")
            await drive(console, so101_joints, 1.0)
            await console.episodes.discard()
            await console.episodes.start("move the tool")
            await drive(console, so101_tool, 1.0)
            kept.append(await console.episodes.redo())
            await drive(console, so101_tool, SECONDS)
            await console.episodes.failure()
        async with asyncio.timeout(PATIENCE):
            while sum("rows" in line for line in said) < 2:  # noqa: ASYNC110
                await asyncio.sleep(0.1)
    return Session(sorted(recordings.glob("*.mcap")), grown, kept)


async def used(directory: Path, *words: str | Path) -> dict[str, Any]:
    """Run the program of the tests that uses a dataset by LeRobot, and return what it saw."""
    process = await asyncio.create_subprocess_exec(
        *(lerobot_python(), "-m", "tests.lerobot.parts.use_dataset", *map(str, words)),
        stdout=asyncio.subprocess.PIPE,
        env={**os.environ, **environment(directory)},
        cwd=ROOT,
    )
    async with asyncio.timeout(PATIENCE):
        output, _ = await process.communicate()
    assert process.returncode == 0
    found: dict[str, Any] = json.loads(output.splitlines()[-1])
    return found


def notes_of(root: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((root / "meta" / "lockstep.json").read_text())
    return found


async def test_the_dataset_that_grew_meanwhile_has_the_kept_episodes_alone_and_each_picture_its_own_event(
    session: Session, tmp_path: Path
) -> None:
    verdict = verify_dataset(session.grown, pixels=True)
    assert verdict.ok, verdict
    assert verdict.checks["shown"].looked == 2 * verdict.rows  # both cameras
    notes = notes_of(session.grown)
    assert [each["episode"] for each in notes["episodes"]] == session.kept
    assert [each["outcome"] for each in notes["episodes"]] == ["success", "failure"]
    seen = await used(tmp_path, "load", session.grown)
    assert (seen["episodes"], seen["frames"], seen["fps"]) == (2, verdict.rows, FPS)
    assert seen["names"]["action"] == seen["names"]["observation.state"] == [f"{joint}.pos" for joint in JOINTS]
    assert seen["shapes"]["action"][1:] == [3, 6]
    assert seen["shapes"][CAMERAS[0]][1:] == [2, 3, 480, 640]
    assert seen["shapes"][CAMERAS[1]][1:] == [2, 3, 240, 320]
    assert seen["driver"] == "Ada"
    # LeRobot's own pictures, read by a program of its own.
    assert seen["drawn"] == seen["stamps"]
    gaps = [event - stamp for event, stamps in zip(seen["events"], seen["stamps"], strict=True) for stamp in stamps]
    assert min(gaps) >= 0
    assert max(gaps) <= TOLERANCE


async def test_after_an_episode_is_discarded_late_lerobot_loads_what_is_left_and_each_picture_is_its_rows(
    session: Session, tmp_path: Path
) -> None:
    """Of a dataset with a file for each episode, and of one in which the episodes share a file."""
    recordings = [Path(shutil.copy(path, tmp_path)) for path in session.recordings]
    grown = shutil.copytree(session.grown, tmp_path / "grown")
    options = DatasetOptions(fps=FPS)
    (shared,) = export_lerobot.export_all(recordings, tmp_path / "shared", options)
    (path,) = recordings
    change(path, {"episode": session.kept[0], "dropped": True})
    for root in (grown, shared):
        said: list[str] = []
        append_once(recordings, root, options, said.append)
        assert said[0].endswith(f": discarded since, and taken out of {root.name}, which has 1 left")
        verdict = verify_dataset(root, pixels=True, recordings=tmp_path)
        assert verdict.ok, verdict
        seen = await used(tmp_path, "load", root)
        assert (seen["episodes"], seen["frames"]) == (1, verdict.rows)
        assert (seen["task"], set(seen["episode"])) == ("move the tool", {0})
        assert seen["drawn"] == seen["stamps"]


async def test_the_joints_lead_the_arm_whoever_moved_them(session: Session, tmp_path: Path) -> None:
    """The second episode moved the tool: its joint goals are where the tool had brought them."""
    (root,) = export_lerobot.export_all(session.recordings, tmp_path / "events", "")
    seen = await used(tmp_path, "load", root)
    for episode in (0, 1):
        rows = [number for number, each in enumerate(seen["episode"]) if each == episode]
        moved = [abs(seen["state"][row + 1][0] - seen["state"][row][0]) for row in rows[:-1]]
        ahead = [seen["action"][row][0] - seen["state"][row][0] for row in rows[:-1]]
        follows = [seen["state"][row + 1][0] - seen["state"][row][0] for row in rows[:-1]]
        assert max(moved) > 0.001
        together = sum(a * b for a, b in zip(ahead, follows, strict=True))
        assert together > 0.0  # the arm goes where the action says


async def test_lerobot_merges_a_dataset_that_grew_with_an_exported_one(session: Session, tmp_path: Path) -> None:
    (root,) = export_lerobot.export_all(session.recordings, tmp_path / "one", DatasetOptions(fps=FPS))
    merged = await used(tmp_path, "merge", tmp_path / "merged", session.grown, root)
    whole = await used(tmp_path, "load", root)
    assert merged["episodes"] == 4
    assert merged["events"] == [*whole["events"], *whole["events"]]
    assert merged["drawn"] == [*whole["stamps"], *whole["stamps"]]
    assert merged["drivers"] == ["Ada"]


async def test_lerobot_trains_act_on_it_without_any_download(session: Session, tmp_path: Path) -> None:
    said = await run_lerobot(
        *(tmp_path, "lerobot-train", "--dataset.repo_id=tests/grown", f"--dataset.root={session.grown}"),
        *(*SMALL_ACT, f"--output_dir={tmp_path / 'out'}"),
    )
    assert "step:3" in said
    assert "End of training" in said


async def test_a_robot_of_rates_trains_too(tmp_path: Path) -> None:
    recordings = tmp_path / "recordings"
    async with (
        recorded_stack(tmp_path, "planar", recordings) as stack,
        Console(stack.operator, video=False, audio=False, name="Bo") as console,
    ):
        await console.take_seat()
        await console.episodes.start("drive on")
        await drive(console, lambda seconds, at: {console.description.axes[0].name: 0.2}, 3.0)
        await console.episodes.success()
    choice = LayoutChoice(axes=["base.wz", "base.vx"], extras=["ranges"])
    options = DatasetOptions(fps=FPS, layout=choice)
    (root,) = export_lerobot.export_all(sorted(recordings.glob("*.mcap")), tmp_path / "dataset", options)
    assert verify_dataset(root, pixels=True).ok
    seen = await used(tmp_path, "load", root)
    assert seen["names"]["action"] == ["base.wz.vel", "base.vx.vel"]
    said = await run_lerobot(
        *(tmp_path, "lerobot-train", "--dataset.repo_id=tests/planar", f"--dataset.root={root}"),
        *(*SMALL_ACT, f"--output_dir={tmp_path / 'out'}"),
    )
    assert "End of training" in said


async def test_lerobot_reads_whole_episodes_alone_after_any_step_of_an_append_that_was_cut_short(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    roots = []
    for steps in range(FILES + 1):
        root, file = tmp_path / f"dataset{steps}", GrowingFile(tmp_path / f"{steps}.mcap", KEPT_AND_NOT)
        file.write_until(44)
        following = follower(root)
        assert following.look([file.path]) == 1
        file.write_until(100)
        with monkeypatch.context() as patch, suppress(Killed):
            patch.setattr(appending, "commit", lambda place, files, n=steps: commit(place, files, killed_after(n)))
            following.look([file.path])
        roots.append(root)
    first, whole = [*range(10, 20)], [*range(10, 20), *range(45, 60)]
    assert (await used(tmp_path, "count", *roots))["events"] == [*[first] * FILES, whole]
