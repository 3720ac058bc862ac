"""Recordings of a robot with a goal axis: what is in the file, in each export, in the report and in the verdict."""

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest

from lockstep.protocol.description import Axis
from lockstep.protocol.messages import Feedback, StopState
from lockstep.server.recording.export import export_csv, export_lerobot, export_parquet
from lockstep.server.recording.format.payload import own_record
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord, RobotRecord
from lockstep.server.recording.report.figures import session_figures
from lockstep.server.recording.report.session import read_session
from lockstep.server.recording.verify.verify_file import verify_file
from lockstep.server.recording.writing.queue_items import FeedbackItem, entries_of
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.makers import DESCRIPTION, Story, own_entry, rewritten

EVENTS = 40
DRIVEN = range(10, 30)  # events whose command has a goal; the others let the axis stay
ARM = msgspec.structs.replace(
    DESCRIPTION,
    axes=(
        DESCRIPTION.axes[0],
        Axis(name="j1", label="J1", unit="rad", minimum=-2, maximum=2, slew=1, brake=4, kind="goal", reach=0.3),
    ),
)
Change = Callable[[CommandRecord | FeedbackRecord], dict[str, Any]]


def goal_after(event: int) -> float:
    """The applied goal: 0.02 a command, which is half of the slew."""
    return 0.5 + 0.02 * max(0, min(event, DRIVEN.stop - 1) - DRIVEN.start + 1)


def arm_recording(path: Path, change: Change = lambda record: {}, *, real: bool = False) -> Path:
    def goal_entry(entry: Entry) -> list[Entry]:
        record = entry.record
        if isinstance(record, RobotRecord):
            return [own_entry(msgspec.structs.replace(record, description=ARM), entry.arrived)]
        if isinstance(record, CommandRecord):
            goal = goal_after(record.event) if record.event in DRIVEN else None
            record = msgspec.structs.replace(record, values=[record.values[0], goal], speed=0.5)
        elif isinstance(record, FeedbackRecord):
            goal = goal_after(record.event)
            axes = [record.axes[0], goal - 0.05]  # it hangs lower under its load
            record = msgspec.structs.replace(record, axes=axes, goals=[None, goal])
        else:
            return [entry]
        return [own_entry(msgspec.structs.replace(record, **change(record)), entry.arrived, entry.captured)]

    return rewritten(path, Story(events=EVENTS, real=real).entries(), goal_entry, ARM)


def test_a_feedback_with_goals_is_written_and_read_as_it_was() -> None:
    feedback = Feedback(event=7, issue=1, time=1.0, axes=[0.1, 0.2], goals=[None, 0.25], joints=[0, 0, 0])
    entries = list(entries_of(FeedbackItem(2, 1, "e", feedback), ARM))
    record = next(own_record(FeedbackRecord, entry.data) for entry in entries if entry.record is not None)
    assert record.goals == [None, 0.25]


def test_a_recording_from_before_there_were_goals_reads_as_one_without_them() -> None:
    record = own_record(
        CommandRecord,
        msgspec.json.encode(
            {"epoch": "e", "event": 2, "issue": 1, "values": [0.5], "peer": "p", "name": "A", "outcome": "forwarded"}
        ),
    )
    assert (record.values, record.speed) == ([0.5], 1.0)


def test_csv_has_an_empty_cell_where_the_axis_was_to_stay_and_its_applied_goal(tmp_path: Path) -> None:
    (target,) = export_csv.export(arm_recording(tmp_path / "a.mcap"), None, "")
    rows = list(csv.DictReader(target.read_text(encoding="utf-8").splitlines()))
    assert "goal.base.vx" not in rows[0]
    assert [row["command.j1"] != "" for row in rows[1:]] == [event in DRIVEN for event in range(2, EVENTS + 1)]
    assert [float(row["goal.j1"]) for row in rows] == pytest.approx([goal_after(e) for e in range(1, EVENTS + 1)])


def test_parquet_has_null_where_the_axis_was_to_stay(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    (target,) = export_parquet.export(arm_recording(tmp_path / "a.mcap"), None, "")
    table = pq.read_table(target)
    assert table.column("command.j1").null_count == EVENTS - len(DRIVEN)
    assert table.column("goal.j1").null_count == 0


def test_a_lerobot_action_is_the_goal_where_the_axis_stayed_and_never_nan(tmp_path: Path) -> None:
    (root,) = export_lerobot.export(arm_recording(tmp_path / "a.mcap", real=True), tmp_path / "dataset", "")
    table = pq.read_table(root / "data" / "chunk-000" / "file-000.parquet")
    actions = np.array(table.column("action").to_pylist())
    events = table.column("lockstep.event").to_pylist()
    assert actions[:, 1] == pytest.approx([goal_after(event + 1) for event in events], abs=1e-6)
    assert np.isfinite(actions).all()
    assert "NaN" not in json.dumps(json.loads((root / "meta" / "stats.json").read_text()))


def test_a_lerobot_frame_whose_axis_stayed_nobody_knows_where_is_left_out(tmp_path: Path) -> None:
    def without_goals(record: CommandRecord | FeedbackRecord) -> dict[str, Any]:
        return {"goals": []} if isinstance(record, FeedbackRecord) else {}

    path = arm_recording(tmp_path / "a.mcap", without_goals, real=True)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    table = pq.read_table(root / "data" / "chunk-000" / "file-000.parquet")
    assert table.column("lockstep.event").to_pylist() == [event - 1 for event in DRIVEN]


def test_the_report_draws_an_axis_that_was_driven_with_gaps_where_it_was_to_stay(tmp_path: Path) -> None:
    session = read_session(arm_recording(tmp_path / "a.mcap"))
    commanded = session.commanded["j1"].values
    assert sum(map(math.isnan, commanded)) == EVENTS - 1 - len(DRIVEN)
    assert session.applied.keys() == {"j1"}
    axes = next(figure for figure in session_figures(session) if figure.name == "axes")
    assert "applied goal" in axes.svg
    assert "J1" in axes.svg


def faults(path: Path) -> list[str]:
    verdict = verify_file(path)
    assert {name for name, check in verdict.checks.items() if not check.ok} <= {"goals"}
    return [violation.text for violation in verdict.checks["goals"].violations]


def test_goals_that_move_no_faster_than_they_may_are_verified(tmp_path: Path) -> None:
    path = arm_recording(tmp_path / "a.mcap")
    assert faults(path) == []
    assert verify_file(path).checks["goals"].looked == EVENTS


def test_a_recording_without_goal_axes_has_none_to_look_at(tmp_path: Path) -> None:
    Story(events=EVENTS).write(tmp_path / "a.mcap")
    assert verify_file(tmp_path / "a.mcap").checks["goals"].looked == 0


@pytest.mark.parametrize(
    ("kind", "values", "words"),
    [
        (FeedbackRecord, {"goals": [None, 1.5]}, "the applied goal of j1 moved by"),
        (FeedbackRecord, {"goals": []}, "a feedback has no applied goals"),
        (FeedbackRecord, {"goals": [0.0, 0.7]}, "a goal of base.vx"),
        (CommandRecord, {"values": [0.5, 1.9]}, "a goal of j1 was"),
        (CommandRecord, {"values": [None, 0.7]}, "a command has no value for base.vx"),
    ],
)
def test_what_goal_axes_do_not_do_is_found(kind: type, values: dict[str, Any], words: str, tmp_path: Path) -> None:
    def tampered(record: CommandRecord | FeedbackRecord) -> dict[str, Any]:
        return values if isinstance(record, kind) and record.event == 20 else {}

    found = faults(arm_recording(tmp_path / "a.mcap", tampered))
    assert found
    assert words in found[0]


def test_after_a_reset_goals_begin_where_the_robot_is(tmp_path: Path) -> None:
    def stopped(record: CommandRecord | FeedbackRecord) -> dict[str, Any]:
        if isinstance(record, FeedbackRecord) and record.event > DRIVEN.stop:
            return {"goals": [None, -1.0], "axes": [0.0, -1.0], "stop": StopState(number=1)}
        return {}

    assert faults(arm_recording(tmp_path / "a.mcap", stopped)) == []
