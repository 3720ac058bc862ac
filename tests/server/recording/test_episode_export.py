"""Episodes in datasets: exactly the kept ones, each row with the picture of its own event."""

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import av
import msgspec
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from lockstep.protocol.serial import MAX_EVENT, event_after
from lockstep.server.recording.episodes.edits import EpisodeEdit, EpisodeEditRefused, add_edit, edits_path
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export import export_csv, export_lerobot, export_mp4, export_parquet
from lockstep.server.recording.export.lerobot_rows import aligned_stamps, episodes_of
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import Degraded, EpisodeRecord
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.graders import PASSED, doctor_counts, doctor_findings, graded_defects
from tests.server.recording.makers import EPOCH, INFO, INTERVAL, START, Story, own_entry, rewritten

DATA = Path("data/chunk-000/file-000.parquet")
OTHER = msgspec.structs.replace(INFO, recording="20270115-planar-cd34")
VIDEO = Path("videos/observation.images.front/chunk-000/file-000.mp4")


def episode(id: str, kind: str, first: int, last: int, **more: object) -> Entry:
    """A record at event `last`, behind everything of that event; events begin at 1."""
    record = EpisodeRecord(
        epoch=EPOCH,
        event=last,
        episode=id,
        number=1,
        kind=kind,  # type: ignore[arg-type]
        task=str(more.pop("task", "push")),
        first_event=first,
        last_event=last,
        **more,  # type: ignore[arg-type]
    )
    return own_entry(record, START + (last - 1) * INTERVAL + 30_000_000)


def recording(
    path: Path,
    *records: Entry,
    events: int = 100,
    stamps: dict[int, int] | None = None,
    info: RecordingInfo = INFO,
) -> Path:
    """`stamps`: of pictures, where it is not their own event."""
    story = [
        each._replace(event=(stamps or {}).get(each.event, each.event)) if each.topic.startswith(CAMERA) else each
        for each in Story(events=events, real=True).entries()
    ]
    entries = [*story, *records]
    return rewritten(path, sorted(entries, key=lambda entry: entry.arrived), lambda each: [each], info=info)


def shown(root: Path) -> list[float]:
    with av.open(str(root / VIDEO)) as video:
        return [float(each.to_ndarray(format="gray")[100:140, 100:220].mean()) for each in video.decode(video=0)]


def rows(root: Path) -> list[dict[str, Any]]:
    return pq.read_table(root / DATA).to_pylist()  # type: ignore[no-any-return]


KEPT_AND_NOT = (
    episode("a", "start", 10, 10),
    episode("a", "kept", 10, 20, outcome="success"),
    episode("b", "start", 25, 25),
    episode("b", "discarded", 25, 40),
    episode("c", "start", 45, 45, task="wipe"),
    episode("c", "kept", 45, 60, task="wipe", outcome="failure"),
    episode("d", "start", 65, 65),
    episode("d", "cut", 65, 70, why="link_down"),
    episode("e", "start", 80, 80),
)


def test_a_dataset_has_exactly_the_kept_episodes_and_their_rows_show_their_own_events(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "not said")
    found = rows(root)
    events = [row["lockstep.event"] for row in found]
    assert events == [*range(10, 20), *range(45, 60)]
    assert [row["lockstep.stamp"] for row in found] == events
    assert {row["lockstep.gap"] for row in found} == {0}
    assert [row["episode_index"] for row in found] == [0] * 10 + [1] * 15
    assert [row["frame_index"] for row in found] == [*range(10), *range(15)]
    assert [row["lockstep.success"] for row in found] == [1] * 10 + [0] * 15
    assert shown(root) == pytest.approx([2 * event for event in events], abs=6)
    notes = json.loads((root / "meta" / "lockstep.json").read_text())
    assert notes["drivers"] == ["Ada"]
    assert [each["episode"] for each in notes["episodes"]] == ["a", "c"]
    places = pq.read_table(root / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [each["tasks"] for each in places] == [["push"], ["wipe"]]
    assert [(each["dataset_from_index"], each["dataset_to_index"]) for each in places] == [(0, 10), (10, 25)]
    assert verify_dataset(root).ok


def test_a_checker_that_others_wrote_takes_a_dataset_of_several_episodes(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    counts = doctor_counts(root)
    assert counts["FAIL"] == 0, counts
    assert counts["PASS"] >= 5, counts
    assert doctor_findings(root) == (PASSED, [])


def test_a_grader_that_others_wrote_finds_no_defect_but_the_one_that_was_planted(tmp_path: Path) -> None:
    """What is planted are the same episodes twice, as of two recordings: of one recording they come in once."""
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    assert graded_defects(root) == {
        "hygiene.schema_dim_consistency": (1, 0),
        "hygiene.topic_frequency": (2, 0),
        "cross.duplicates": (2, 0),
    }
    again = recording(tmp_path / "b.mcap", *KEPT_AND_NOT, info=OTHER)
    (root,) = export_lerobot.export_all([path, again], tmp_path / "twice", "")
    looked, found = graded_defects(root)["cross.duplicates"]
    assert (looked, found) == (4, 4)


def test_several_recordings_become_one_dataset(tmp_path: Path) -> None:
    kept = (episode("a", "start", 10, 10), episode("a", "kept", 10, 20))
    paths = [
        recording(tmp_path / f"{info.recording}.mcap", *kept, events=30, info=info) for info in (INFO, OTHER)
    ]  # of one recording, the second file would be a copy
    (root,) = export_lerobot.export_all(paths, tmp_path / "dataset", "")
    info = json.loads((root / "meta" / "info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 20, 1)
    assert [row["index"] for row in rows(root)] == list(range(20))
    assert shown(root) == pytest.approx([2 * event for event in [*range(10, 20)] * 2], abs=6)


def test_a_copy_of_a_recording_in_an_export_is_left_out_by_name(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (whole,) = export_lerobot.export(path, tmp_path / "whole", "")
    copy = Path(shutil.copy(path, tmp_path / "copy.mcap"))
    changed(copy, "c", first_event=50)
    said: list[str] = []
    (root,) = export_lerobot.export_all([path, copy], tmp_path / "dataset", say=said.append)
    assert rows(root) == rows(whole)
    assert said == [
        "episode a of copy.mcap is left out: the dataset has it already",
        "episode c of copy.mcap is left out: the dataset has 10 of its 10 events already, as c",
    ]
    assert verify_dataset(root).ok


def test_a_copy_of_a_whole_recording_in_an_export_is_left_out_by_name(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", events=30)
    copy = Path(shutil.copy(path, tmp_path / "copy.mcap"))
    said: list[str] = []
    (root,) = export_lerobot.export_all([path, copy], tmp_path / "dataset", "push", say=said.append)
    assert said == [
        "a.mcap has no episodes and is one as a whole, with the task 'push'",
        "copy.mcap is left out: the dataset has it already",
    ]
    assert verify_dataset(root).ok


def test_a_recording_whose_episodes_were_all_discarded_gives_no_dataset_and_leaves_nothing(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT[2:4])
    with pytest.raises(RecordingDamaged):
        export_lerobot.export(path, tmp_path / "dataset", "")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.mcap"]


def test_a_kept_episode_without_a_row_is_said_by_name_and_noted_in_the_dataset(tmp_path: Path) -> None:
    """Something was left out at event 12, and the next keyframe is that of event 52."""
    lost = own_entry(Degraded(epoch=EPOCH, event=12, lost=1), START + 11 * INTERVAL + 1_000_000)
    more = (episode("b", "start", 25, 25, task="lift"), episode("b", "kept", 25, 40, task="lift"))
    path = recording(tmp_path / "a.mcap", lost, *more, *KEPT_AND_NOT[4:6])
    said: list[str] = []
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", "", say=said.append)
    (line,) = said
    assert line.startswith("episode b of a.mcap is left out: no event has ")
    notes = json.loads((root / "meta" / "lockstep.json").read_text())
    assert [each["episode"] for each in notes["episodes"]] == ["c"]
    (without,) = notes["without_rows"]
    assert (without["episode"], without["task"], without["rows"], without["left_out"]) == ("b", "lift", 0, 15)
    assert verify_dataset(root).ok
    alone = recording(tmp_path / "b.mcap", lost, *more)
    with pytest.raises(RecordingDamaged, match="no kept episode has a row"):
        export_lerobot.export(alone, tmp_path / "none", "")


def test_an_episode_that_was_kept_in_another_file_than_it_began_in_is_in_no_dataset(tmp_path: Path) -> None:
    path = recording(
        tmp_path / "a.mcap",
        episode("z", "kept", 10, 20),
        episode("a", "start", 30, 30),
        episode("a", "kept", 30, 40),
    )
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    assert [row["lockstep.event"] for row in rows(root)] == [*range(30, 40)]


def test_no_picture_from_before_the_episode_is_in_it_and_none_older_than_the_tolerance(tmp_path: Path) -> None:
    """The camera hangs from event 8 to 12 and from event 30 to 40."""
    hangs = dict.fromkeys(range(8, 13), 7) | dict.fromkeys(range(30, 41), 29)  # it gives the same picture again
    path = recording(
        tmp_path / "whole.mcap", episode("a", "start", 10, 10), episode("a", "kept", 10, 50), events=60, stamps=hangs
    )
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", "", tolerance=2)
    found = rows(root)
    assert [row["lockstep.event"] for row in found] == [*range(13, 32), *range(41, 50)]
    assert [row["lockstep.gap"] for row in found][17:19] == [1, 2]
    notes = json.loads((root / "meta" / "lockstep.json").read_text())
    assert (notes["tolerance"], notes["episodes"][0]["left_out"]) == (2, 12)
    assert verify_dataset(root).ok


def test_an_event_that_the_recorder_left_out_makes_no_row_with_the_wrong_action(tmp_path: Path) -> None:
    entries = [each for each in Story(events=30, real=True).entries() if each.event != 15]
    path = rewritten(tmp_path / "a.mcap", entries, lambda each: [each])
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    found = {row["lockstep.event"]: row["action"] for row in rows(root)}
    assert 14 not in found
    assert found[16][0] == pytest.approx(16 / 30)


def test_pictures_that_build_on_one_that_was_left_out_are_in_no_row(tmp_path: Path) -> None:
    """Keyframes are those of events 2 and 52; the recorder says at event 40 that it left something out."""
    lost = own_entry(Degraded(epoch=EPOCH, event=40, lost=3), START + 39 * INTERVAL + 4_000_000)
    path = recording(tmp_path / "a.mcap", lost, episode("a", "start", 30, 30), episode("a", "kept", 30, 60))
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", "", tolerance=0)
    assert [row["lockstep.event"] for row in rows(root)] == [*range(30, 40), *range(52, 60)]


def test_no_row_has_a_picture_that_builds_on_one_that_was_left_out_before_the_episode(tmp_path: Path) -> None:
    """Keyframes are those of events 2 and 52; something was left out at event 26, and the episode begins at 30."""
    lost = own_entry(Degraded(epoch=EPOCH, event=26, lost=1), START + 25 * INTERVAL + 1_000_000)
    path = recording(tmp_path / "a.mcap", lost, episode("a", "start", 30, 30), episode("a", "kept", 30, 60))
    (root,) = export_lerobot.export_all([path], tmp_path / "dataset", "", tolerance=0)
    assert [row["lockstep.event"] for row in rows(root)] == list(range(52, 60))


@pytest.mark.parametrize(
    ("column", "change", "check"),
    [
        ("lockstep.stamp", lambda value: value + 1, "aligned"),
        ("lockstep.stamp", lambda value: value - 5, "aligned"),
        ("lockstep.event", lambda value: 30, "within"),
        ("episode_index", lambda value: 1, "counted"),
    ],
)
def test_the_check_finds_a_row_that_was_changed(tmp_path: Path, column: str, change: object, check: str) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    table = pq.read_table(root / DATA)
    values = table.column(column).to_pylist()
    values[7] = change(values[7])  # type: ignore[operator]
    changed = table.set_column(table.schema.get_field_index(column), column, pa.array(values, pa.int64()))
    pq.write_table(changed, root / DATA)
    verdict = verify_dataset(root)
    assert not verdict.ok
    assert check in {name for name, each in verdict.checks.items() if not each.ok}


def test_the_check_refuses_what_lockstep_has_not_exported(tmp_path: Path) -> None:
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "lockstep.json").write_bytes(msgspec.json.encode({"version": 7}))
    with pytest.raises(RecordingDamaged):
        verify_dataset(tmp_path)


def test_pictures_are_aligned_across_the_wrap_of_the_event_reference() -> None:
    events = [MAX_EVENT - 1, MAX_EVENT, event_after(MAX_EVENT), event_after(event_after(MAX_EVENT))]
    stamps = [MAX_EVENT - 1, MAX_EVENT - 1, MAX_EVENT, 2]
    assert list(aligned_stamps(stamps, events)) == [(0, MAX_EVENT - 1), (2, MAX_EVENT), (2, MAX_EVENT), (3, 2)]


def changed(path: Path, id: str, **change: object) -> list[EpisodeEntry]:
    with RecordingReader(path) as reader:
        edit = EpisodeEdit(episode=id, at=1.0, **change)  # type: ignore[arg-type]
        return [each.entry for each in add_edit(path, episodes_of(reader), edit).episodes]


def test_an_episode_that_is_relabelled_trimmed_or_dropped_is_so_in_the_dataset_and_its_recording_unchanged(
    tmp_path: Path,
) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    before = path.read_bytes()
    changed(path, "a", task="pull", outcome="failure", first_event=12, last_event=18)
    (root,) = export_lerobot.export(path, tmp_path / "one", "")
    found = [row for row in rows(root) if row["episode_index"] == 0]
    assert [row["lockstep.event"] for row in found] == [*range(12, 18)]
    assert {row["lockstep.success"] for row in found} == {0}
    assert pq.read_table(root / "meta/tasks.parquet").column("task").to_pylist() == ["pull", "wipe"]
    changed(path, "a", dropped=True)
    (root,) = export_lerobot.export(path, tmp_path / "two", "")
    assert [row["lockstep.event"] for row in rows(root)] == [*range(45, 60)]
    assert [each.state for each in changed(path, "a", dropped=False)][0] == "kept"
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("id", "change"),
    [
        ("b", {"dropped": False}),  # it was discarded
        ("d", {"outcome": "success"}),  # it was cut
        ("e", {"last_event": 90}),  # it has no end
        ("x", {"task": "x"}),
        ("a", {"first_event": 9}),
        ("a", {"last_event": 21}),
        ("a", {"first_event": 18, "last_event": 18}),
    ],
)
def test_nothing_makes_more_count_than_was_kept(tmp_path: Path, id: str, change: dict[str, object]) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    with pytest.raises(EpisodeEditRefused):
        changed(path, id, **change)
    assert not edits_path(path).exists()


def test_a_file_of_changes_that_somebody_wrote_makes_no_discarded_episode_count(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    lines = ['{"episode":"b","at":1,"dropped":false}', '{"episode":"a","at":1,"last_event":99}', '{"epis', "[]", "\x00"]
    edits_path(path).write_text("\n".join(lines))
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    assert [row["lockstep.event"] for row in rows(root)] == [*range(10, 20), *range(45, 60)]


def test_a_dataset_has_the_marks_within_each_of_its_episodes(tmp_path: Path) -> None:
    bounds = [episode("a", "start", 10, 10), episode("a", "kept", 10, 60)]
    marks = [
        own_entry(
            EpisodeRecord(
                epoch=EPOCH,
                event=event,
                episode="a",
                number=1,
                kind="mark",
                task="push",
                text=text,
                first_event=10,
                last_event=event,
            ),
            START + (event - 1) * INTERVAL + 30_000_000,
        )
        for event, text in ((12, "touched"), (30, "slipped"), (55, "mark"))
    ]
    path = recording(tmp_path / "a.mcap", *bounds, *marks)
    with RecordingReader(path) as reader:
        recorded = episodes_of(reader)
    assert noted(path, tmp_path / "whole") == [[(12, "touched"), (30, "slipped"), (55, "mark")]]
    add_edit(path, recorded, EpisodeEdit(at=1.0, by="x", episode="a", first_event=14, last_event=55))
    assert noted(path, tmp_path / "trimmed") == [[(30, "slipped"), (55, "mark")]]
    add_edit(path, recorded, EpisodeEdit(at=2.0, by="x", episode="a", split=40))
    assert noted(path, tmp_path / "split") == [[(30, "slipped")], [(55, "mark")]]


def noted(path: Path, out: Path) -> list[list[tuple[int, str]]]:
    """The marks of each episode of a new dataset."""
    (root,) = export_lerobot.export(path, out, "")
    assert verify_dataset(root).ok
    notes = json.loads((root / "meta" / "lockstep.json").read_text())
    return [[(event, text) for event, text in each["marks"]] for each in notes["episodes"]]


def test_a_table_of_kept_episodes_has_no_row_of_another(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    with RecordingReader(path) as reader:
        add_edit(path, episodes_of(reader), EpisodeEdit(at=1.0, by="x", episode="c", dropped=True))
    (table,) = export_parquet.export(path, tmp_path / "a.parquet", "", kept=True)
    found = pq.read_table(table).to_pylist()
    assert [row["event"] for row in found] == [*range(11, 21)], "without b, d and e, and c was discarded since"
    (text,) = export_csv.export(path, tmp_path / "a.csv", "", kept=True)
    with text.open(encoding="utf-8") as file:
        assert [int(row["event"]) for row in csv.DictReader(file)] == [*range(11, 21)]


def test_a_table_of_kept_episodes_is_empty_where_there_are_none(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap")
    (table,) = export_parquet.export(path, tmp_path / "a.parquet", "", kept=True)
    assert pq.read_table(table).num_rows == 0


def test_tables_and_films_say_of_each_event_which_episode_it_was_driven_in(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    with RecordingReader(path) as reader:
        add_edit(path, episodes_of(reader), EpisodeEdit(at=1.0, by="x", episode="c", task="mop"))
    (table,) = export_parquet.export(path, tmp_path / "a.parquet", "")
    rows = {row["event"]: row for row in pq.read_table(table).to_pylist()}
    names = ("episode", "episode_state", "task", "outcome")
    said = {event: tuple(row[name] for name in names) for event, row in rows.items()}
    a, c = ("a", "kept", "push", "success"), ("c", "kept", "mop", "failure")
    assert [said[event] for event in (10, 11, 20, 21)] == [("", "", "", ""), a, a, ("", "", "", "")]
    assert [said[event] for event in (26, 46, 60, 61)] == [("b", "discarded", "push", ""), c, c, ("", "", "", "")]
    (text,) = export_csv.export(path, tmp_path / "a.csv", "")
    with text.open(encoding="utf-8") as file:
        assert [tuple(row[name] for name in names) for row in csv.DictReader(file)] == list(said.values())
    (film,) = export_mp4.export(path, tmp_path / "a.mp4", "")
    with av.open(str(film)) as shown:
        chapters = {each["metadata"]["title"]: each for each in shown.chapters()}
        assert next(iter(shown.decode(video=0)))
    assert list(chapters)[0] == "no episode"
    assert list(chapters)[1:4] == ["1: push (kept, success)", "1: push (discarded)", "1: mop (kept, failure)"]
    first = chapters["1: push (kept, success)"]
    base = first["time_base"]
    assert base is not None
    seconds = [float(each * base) for each in (first["start"], first["end"])]
    assert seconds == pytest.approx([10 * INTERVAL / 1e9, 19 * INTERVAL / 1e9], abs=INTERVAL / 1e9)


def test_a_recording_without_episodes_has_no_columns_of_them(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap")
    (table,) = export_parquet.export(path, tmp_path / "a.parquet", "")
    assert "episode" not in pq.read_schema(table).names
