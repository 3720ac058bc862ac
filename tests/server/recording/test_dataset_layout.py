"""What is state and action of a dataset, by which name; and who is said to have driven."""

import json
from pathlib import Path
from typing import Any

import msgspec
import pyarrow.parquet as pq
import pytest

from lockstep.protocol.description import Axis, Joint, Pose, RobotDescription
from lockstep.server.recording.errors import DatasetRefused
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.export_lerobot import DatasetOptions
from lockstep.server.recording.export.lerobot_layout import LayoutChoice, layout_of
from lockstep.server.recording.format.drivers import EventDriver
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.makers import DESCRIPTION, Story, own_entry, rewritten
from tests.server.recording.test_episode_export import episode, rows


def goal(name: str, unit: str = "rad") -> Axis:
    return Axis(name=name, label=name, unit=unit, minimum=-2, maximum=2, slew=1, brake=4, kind="goal", reach=0.5)


ARM = RobotDescription(
    name="arm",
    label="Arm",
    axes=(goal("pan"), goal("lift"), goal("grip.pos", "%"), goal("tool.x", "m"), goal("tool.y", "m")),
    joints=(Joint(name="pan", unit="rad"), Joint(name="lift", unit="rad")),
    poses=(
        Pose(name="tool", label="Tool", body="hand", position=("tool.x", "tool.y", ""), instead_of=("pan", "lift")),
    ),
)


def feedback(event: int, goals: list[float | None], **more: Any) -> FeedbackRecord:
    axes = [0.1, 0.2, 50.0, 0.3, 0.4]
    return FeedbackRecord(epoch="e", event=event, issue=1, time=1.0, axes=axes, joints=[0.1, 0.2], goals=goals, **more)


def command(values: list[float | None]) -> CommandRecord:
    return CommandRecord(epoch="e", event=2, issue=1, values=values, peer="p", name="A", outcome="forwarded")


def test_state_and_action_of_an_arm_have_the_same_names_and_no_pose() -> None:
    layout = layout_of(ARM)
    assert layout.names == {
        "observation.state": ["pan.pos", "lift.pos", "grip.pos"],
        "action": ["pan.pos", "lift.pos", "grip.pos"],
    }
    assert layout.units == {"pan.pos": "rad", "lift.pos": "rad", "grip.pos": "%"}
    assert layout.state(feedback(1, [])) == {"observation.state": [0.1, 0.2, 50.0]}


def test_an_axis_that_stays_has_its_goal_and_joints_that_a_pose_drives_have_where_it_brought_them() -> None:
    layout = layout_of(ARM)
    answer, after = feedback(2, [0.11, 0.21, 51.0, 0.3, 0.4]), feedback(3, [0.15, 0.25, 52.0, 0.3, 0.4])
    assert layout.action(command([0.5, None, None, None, None]), answer, after) == [0.5, 0.21, 51.0]
    assert layout.action(command([None, None, 60.0, 0.31, 0.4]), answer, after) == [0.15, 0.25, 60.0]
    assert layout.action(command([None, None, 60.0, 0.31, 0.4]), answer, None) is None
    assert layout.action(command([None, None, None, None, None]), feedback(2, []), after) is None


def test_a_value_that_is_not_known_makes_no_row() -> None:
    assert layout_of(ARM).state(feedback(1, [], unknown=["lift"])) is None
    chosen = LayoutChoice(axes=["tool.x"], state=["pan", "tool.x.pos"])
    assert layout_of(ARM, chosen).state(feedback(1, [], unknown=["lift"])) == {"observation.state": [0.1, 0.3]}


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        (LayoutChoice(axes=["elbow"]), "no elbow; there are pan.pos"),
        (LayoutChoice(state=["elbow"]), "no elbow"),
        (LayoutChoice(extras=["wrench"]), "no force sensor"),
        (LayoutChoice(extras=["ranges"]), "no range sensors"),
    ],
)
def test_what_the_robot_has_not_is_refused_by_name(choice: LayoutChoice, said: str) -> None:
    with pytest.raises(DatasetRefused, match=said):
        layout_of(ARM, choice)


def driven(path: Path, *, by_feedback: bool = True) -> Path:
    """A policy drives, a person corrects it from event 15 on, and the policy goes on from event 20 on.

    Args:
        by_feedback: feedbacks name their drivers; else the commands alone do
    """

    def by(event: int) -> EventDriver:
        return EventDriver("Bo", "human", True) if 15 <= event < 20 else EventDriver("act", "policy")

    def change(entry: Entry) -> list[Entry]:
        record, driver = entry.record, by(entry.event)
        if isinstance(record, CommandRecord):
            changed = msgspec.structs.replace(record, peer=driver.name, name=driver.name, kind=driver.kind)
            return [own_entry(changed, entry.arrived)]
        if isinstance(record, FeedbackRecord) and by_feedback and entry.event > 1:
            named = msgspec.structs.replace(
                record, driver=driver.name, driver_kind=driver.kind, intervention=driver.intervention
            )
            return [own_entry(named, entry.arrived, entry.captured)]
        return [entry]

    entries = [
        *Story(events=40, real=True).entries(),
        episode("a", "start", 10, 10),
        episode("a", "kept", 10, 25),
    ]
    return rewritten(path, sorted(entries, key=lambda each: each.arrived), change, DESCRIPTION)


@pytest.mark.parametrize("by_feedback", [True, False])
def test_each_row_says_who_sent_its_action_and_where_a_person_intervened(tmp_path: Path, by_feedback: bool) -> None:
    (root,) = export_lerobot.export(driven(tmp_path / "a.mcap", by_feedback=by_feedback), tmp_path / "dataset", "")
    found = {row["lockstep.event"]: row for row in rows(root)}
    corrected = range(14, 19)  # their actions are commands 15 to 19
    assert {event for event, row in found.items() if row["lockstep.intervention"]} == set(corrected)
    assert {event for event, row in found.items() if row["lockstep.driver"] == "Bo"} == set(corrected)
    assert {row["lockstep.driver_kind"] for event, row in found.items() if event not in corrected} == {"policy"}
    assert json.loads((root / "meta/lockstep.json").read_text())["drivers"] == ["act", "Bo"]


def test_wrench_and_ranges_are_columns_of_their_own_where_they_are_asked_for(tmp_path: Path) -> None:
    choice = LayoutChoice(axes=["base.wz"], extras=["wrench", "ranges"])
    path = driven(tmp_path / "a.mcap")
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", DatasetOptions(layout=choice, fps=10))
    (row, *_) = rows(root)
    assert row["observation.wrench"] == pytest.approx([0.1, 0, 0, 0, 0, 0])
    assert row["observation.ranges"] == [1.0, 2.0, 3.0]
    features = json.loads((root / "meta/info.json").read_text())["features"]
    assert features["observation.state"]["names"] == ["x.pos", "y.pos", "yaw.pos", "base.wz.vel"]
    assert verify_dataset(root).ok


def test_a_row_at_another_moment_than_the_rate_says_is_found(tmp_path: Path) -> None:
    (root,) = export_lerobot.export_all([driven(tmp_path / "a.mcap")], tmp_path / "dataset", DatasetOptions(fps=10))
    path = root / "data/chunk-000/file-000.parquet"
    table = pq.read_table(path)
    ages = table.column("lockstep.age").to_pylist()
    place = table.schema.get_field_index("lockstep.age")
    pq.write_table(table.set_column(place, "lockstep.age", [[ages[0], ages[1] + 0.03, *ages[2:]]]), path)
    verdict = verify_dataset(root)
    assert [name for name, check in verdict.checks.items() if not check.ok] == ["timed"]
