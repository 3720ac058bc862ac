"""Datasets beside their recordings: episodes that were discarded or changed since are named."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lockstep.server.cli.main import app
from lockstep.server.recording.episodes.edits import edits_path
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.episodes.test_edited_datasets import NEXT, change
from tests.server.recording.makers import INFO
from tests.server.recording.test_episode_export import KEPT_AND_NOT, episode, recording

ID = INFO.recording


def differences(root: Path, folder: Path) -> list[str]:
    verdict = verify_dataset(root, recordings=folder)
    broken = {name for name, check in verdict.checks.items() if not check.ok}
    assert broken == ({"current"} if not verdict.ok else set())
    return [each.text for each in verdict.checks["current"].violations]


def test_episodes_that_were_discarded_changed_or_split_after_the_export_are_named(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    path = recording(folder / "a.mcap", *KEPT_AND_NOT[:6], *NEXT)
    (folder / "broken.mcap").write_bytes(b"no recording")
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    assert differences(root, folder) == []
    assert not verify_dataset(root).checks["current"].looked
    change(path, {"episode": "a", "dropped": True}, {"episode": "c", "first_event": 50}, {"episode": "f", "split": 80})
    change(path, {"episode": "c", "outcome": "success"})
    assert differences(root, folder) == [
        f"episode a of {ID} is discarded",
        f"episode c of {ID} was changed: first event 45 is 50, outcome failure is success",
        f"episode f of {ID} was split, merged, or put together again",
    ]
    path.unlink()
    assert differences(root, folder)[0] == f"episode a of {ID}: the recording is not there, or cannot be read"


@pytest.mark.parametrize("copy", [shutil.copyfile, lambda path, to: to.symlink_to(path)], ids=["copy", "link"])
def test_a_copy_without_the_changes_hides_no_discarded_episode(
    tmp_path: Path, copy: Callable[[Path, Path], object]
) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    path = recording(folder / "m.mcap", *KEPT_AND_NOT[:6], *NEXT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    change(path, {"episode": "a", "dropped": True})
    for name in ("a.mcap", "z.mcap"):
        copy(path, folder / name)
    assert differences(root, folder) == [f"episode a of {ID} is discarded"]


def test_a_recording_that_cannot_be_read_is_named_beside_a_copy_that_can(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    path = recording(folder / "m.mcap", *KEPT_AND_NOT[:6], *NEXT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    shutil.copyfile(path, folder / "z.mcap")
    edits_path(path).mkdir()
    found = differences(root, folder)
    assert found
    assert all("cannot be read" in each for each in found)


def test_each_of_many_episodes_is_named_and_of_other_checks_how_many_more_there_are(tmp_path: Path) -> None:
    count = 60
    kept = [
        each
        for number in range(count)
        for each in (
            episode(f"e{number}", "start", 5 + 2 * number, 5 + 2 * number),
            episode(f"e{number}", "kept", 5 + 2 * number, 7 + 2 * number),
        )
    ]
    folder = tmp_path / "recordings"
    folder.mkdir()
    path = recording(folder / "a.mcap", *kept, events=130)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    path.unlink()
    assert len(differences(root, folder)) == count
    notes = root / "meta" / "lockstep.json"
    notes.write_text(notes.read_text().replace('"tolerance": 4', '"tolerance": -1'))
    arguments = ["verify", str(root), "--recordings", str(folder)]
    output = CliRunner().invoke(app, arguments, env={"LOCKSTEP_STATE_DIR": str(tmp_path / "state")}).output
    assert output.count("the recording is not there") == count
    assert output.count("\n        and ") == 1, "of `aligned`"
    assert f"\n        and {2 * count - 5} more\n" in output


def test_a_whole_recording_that_turns_out_to_have_episodes_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    path = recording(folder / "a.mcap", events=70)
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", DatasetOptions(whole=True))
    assert differences(root, folder) == []
    path.unlink()
    recording(path, *KEPT_AND_NOT[:6], events=70)
    assert differences(root, folder) == [f"all of {ID}: the recording has episodes"]
