"""What becomes of split and merged episodes in a dataset."""

import json
from pathlib import Path
from typing import Any

from lockstep.server.recording.episodes.edits import EpisodeEdit, add_edit
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.test_episode_export import KEPT_AND_NOT, episode, recording, rows

NEXT = (episode("f", "start", 70, 70), episode("f", "kept", 70, 90, outcome="success"))


def change(path: Path, *edits: dict[str, Any]) -> None:
    with RecordingReader(path) as reader:
        recorded = episodes_of(reader)
    for each in edits:
        add_edit(path, recorded, EpisodeEdit(at=1.0, **each))


def test_the_parts_of_a_split_have_together_the_rows_of_the_whole(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (whole,) = export_lerobot.export(path, tmp_path / "whole", "")
    change(path, {"episode": "a", "split": 15}, {"episode": "edit-1b", "task": "pull"})
    (parts,) = export_lerobot.export(path, tmp_path / "parts", "")
    events = [row["lockstep.event"] for row in rows(parts)]
    assert events == [row["lockstep.event"] for row in rows(whole)]
    assert [row["episode_index"] for row in rows(parts)] == [0] * 5 + [1] * 5 + [2] * 15
    notes = json.loads((parts / "meta" / "lockstep.json").read_text())["episodes"]
    assert [(each["episode"], each["task"]) for each in notes] == [
        ("edit-1a", "push"),
        ("edit-1b", "pull"),
        ("c", "wipe"),
    ]
    assert verify_dataset(parts).ok


def test_a_merged_episode_is_one_with_the_rows_between_and_a_discarded_part_leaves_none(tmp_path: Path) -> None:
    kept = (episode("c", "start", 45, 45), episode("c", "kept", 45, 60), *NEXT)
    path = recording(tmp_path / "a.mcap", *kept)
    change(
        path,
        {"episode": "c", "merge": "f"},
        {"episode": "edit-1", "split": 50},
        {"episode": "edit-2a", "dropped": True},
    )
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    assert [row["lockstep.event"] for row in rows(root)] == [*range(50, 90)]
    assert {row["episode_index"] for row in rows(root)} == {0}
    assert verify_dataset(root).ok
