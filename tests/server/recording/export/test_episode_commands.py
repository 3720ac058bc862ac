"""What a dataset notes of an episode's commands: delays and refusals, of its own events alone."""

import json
from pathlib import Path
from typing import Any

import msgspec

from lockstep.protocol.console import DriverKind
from lockstep.protocol.messages import RefusalReason
from lockstep.server.cli.recordings.follow import append_once
from lockstep.server.recording.dataset.appending import read_state
from lockstep.server.recording.episodes.edits import EpisodeEdit, add_edit
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.episode_commands import MAX_DRIVERS, CommandTally, EpisodeCommands
from lockstep.server.recording.export.export_lerobot import DatasetOptions, export_all
from lockstep.server.recording.export.lerobot_meta import DatasetNotes
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.format.drivers import NOBODY
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import CommandRecord, RefusalRecord
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.report.totals import Totals
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.makers import EPOCH, INTERVAL, START, Story, own_entry, rewritten
from tests.server.recording.test_episode_export import episode

MS = 1_000_000  # ns


def refusal(event: int, name: str = "Ada", reason: RefusalReason = "late", after: int = 20, refused: int = -1) -> Entry:
    """A refusal `after` ms after the event's feedback; records of episodes come after 30 ms."""
    record = RefusalRecord(
        epoch=EPOCH, event=event, refused=event + 1 if refused < 0 else refused, reason=reason, by="robot", name=name
    )
    return own_entry(record, START + (event - 1) * INTERVAL + after * MS)


def driven(path: Path, *records: Entry, kept: tuple[tuple[str, int, int], ...] = (("a", 10, 20),)) -> Path:
    """Ada's commands take 10 ms, and from event 16 on a policy's 31 ms."""

    def change(entry: Entry) -> list[Entry]:
        record = entry.record
        if isinstance(record, CommandRecord) and record.event >= 16:
            return [own_entry(msgspec.structs.replace(record, name="net", kind="policy"), entry.arrived - 21 * MS)]
        return [entry]

    bounds = [each for id, first, last in kept for each in (
        episode(id, "start", first, first), episode(id, "kept", first, last, outcome="success")
    )]  # fmt: skip
    story = [each for entry in Story(events=40, real=True).entries() for each in change(entry)]
    entries = sorted([*story, *bounds, *records], key=lambda each: each.arrived)
    return rewritten(path, entries, lambda each: [each])


def noted(root: Path) -> list[EpisodeCommands]:
    notes = msgspec.json.decode((root / "meta/lockstep.json").read_bytes(), type=DatasetNotes)
    assert verify_dataset(root).ok
    return [each.commands for each in notes.episodes if each.commands is not None]


def exported(path: Path, out: str = "dataset") -> list[EpisodeCommands]:
    (root,) = export_lerobot.export(path, path.parent / out, "")
    return noted(root)


def edit(path: Path, **change: Any) -> None:
    with RecordingReader(path) as reader:
        add_edit(path, episodes_of(reader), EpisodeEdit(at=1.0, **change))


def drivers(commands: EpisodeCommands) -> dict[tuple[str, DriverKind], tuple[dict[float, int], dict[str, int]]]:
    return {(each.name, each.kind): (each.delays, each.refused) for each in commands.drivers}


def test_an_episode_notes_how_long_its_commands_took_for_all_and_by_driver(tmp_path: Path) -> None:
    (commands,) = exported(driven(tmp_path / "a.mcap"))
    assert drivers(commands) == {("Ada", "human"): ({10.0: 5}, {}), ("net", "policy"): ({31.0: 5}, {})}
    assert (commands.median_ms, commands.p95_ms) == (31.0, 31.0)
    assert [(each.median_ms, each.p95_ms) for each in commands.drivers] == [(10.0, 10.0), (31.0, 31.0)]


def test_the_notes_have_the_delays_that_the_report_of_the_recording_has(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", kept=(("a", 1, 40),))
    (commands,) = exported(path)
    totals = Totals(None)
    with RecordingReader(path) as reader:
        for record in reader.records():
            own = own_record_of(record.schema, record.data)
            if own is not None:
                totals.own(own, record.arrived // 1000)
    answered = totals.drivers["Ada"].answered  # who had the seat all the time
    assert (
        (answered.percentile(0.5), answered.percentile(0.95)) == (commands.median_ms, commands.p95_ms) == (31.0, 31.0)
    )
    assert answered.percentile(0.3) == 10.0


def test_refusals_count_from_the_recorded_begin_of_an_episode_to_its_end(tmp_path: Path) -> None:
    counted = [refusal(10, after=35), refusal(12), refusal(20, reason="stopped"), refusal(17, "Bo", "no_seat")]
    others = [refusal(9), refusal(10), refusal(20, after=35), refusal(21), refusal(12, reason="seat_taken", refused=0)]
    (commands,) = exported(driven(tmp_path / "a.mcap", *counted, *others))
    assert {key: refused for key, (_, refused) in drivers(commands).items()} == {
        ("Ada", "human"): {"late": 2, "stopped": 1},
        ("Bo", "none"): {"no_seat": 1},
        ("net", "policy"): {},
    }
    assert commands.refused == {"late": 2, "no_seat": 1, "stopped": 1}


def test_a_refused_command_tells_what_its_sender_is(tmp_path: Path) -> None:
    sent = CommandRecord(
        epoch=EPOCH,
        event=13,
        issue=1,
        values=[],
        peer="p",
        name="arm",
        outcome="refused",
        reason="no_seat",
        kind="policy",
    )
    at = START + 11 * INTERVAL + 19 * MS
    path = driven(tmp_path / "a.mcap", own_entry(sent, at), refusal(12, "arm", "no_seat"), refusal(12, "", "link_down"))
    (commands,) = exported(path)
    assert drivers(commands)["arm", "policy"] == ({}, {"no_seat": 1})
    assert drivers(commands)["", "none"] == ({}, {"link_down": 1})


def test_the_parts_of_a_split_episode_have_each_command_once(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", *(refusal(event) for event in range(9, 22)))
    (whole,) = exported(path)
    edit(path, episode="a", split=15)
    one, other = map(drivers, exported(path, "parts"))
    assert drivers(whole)["Ada", "human"] == ({10.0: 5}, {"late": 10}), "10 is before the begin"
    assert one == {("Ada", "human"): ({10.0: 5}, {"late": 4})}
    assert other == {("Ada", "human"): ({}, {"late": 6}), ("net", "policy"): ({31.0: 5}, {})}


def test_a_trimmed_episode_counts_only_what_is_left_of_it(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", *(refusal(event) for event in range(9, 22)))
    edit(path, episode="a", first_event=12, last_event=17)
    (commands,) = exported(path)
    assert drivers(commands) == {("Ada", "human"): ({10.0: 3}, {"late": 5}), ("net", "policy"): ({31.0: 2}, {})}


def test_a_merged_episode_counts_what_is_between_its_parts_too(tmp_path: Path) -> None:
    kept = (("a", 2, 8), ("b", 10, 14))
    path = driven(tmp_path / "a.mcap", *(refusal(event) for event in range(1, 20)), kept=kept)
    one, other = map(drivers, exported(path, "parts"))
    assert one["Ada", "human"] == ({10.0: 6}, {"late": 6})
    assert other["Ada", "human"] == ({10.0: 4}, {"late": 4})
    edit(path, episode="a", merge="b")
    (merged,) = map(drivers, exported(path, "whole"))
    assert merged["Ada", "human"] == ({10.0: 12}, {"late": 12})


def test_a_recording_as_a_whole_counts_all_of_it(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", refusal(1), refusal(40), kept=())
    (commands,) = exported(path)
    assert drivers(commands)["Ada", "human"] == ({10.0: 14}, {"late": 2})


def test_a_dataset_that_grew_notes_what_an_export_notes_and_exports_are_the_same(tmp_path: Path) -> None:
    kept = (("a", 2, 8), ("b", 10, 20))
    path = driven(tmp_path / "a.mcap", refusal(3), refusal(12, "Bo"), refusal(12, "Al"), kept=kept)
    whole = exported(path)
    append_once([path], tmp_path / "grown", DatasetOptions(), print)
    assert noted(tmp_path / "grown") == whole
    exported(path, "again")
    names = [each.relative_to(tmp_path / "again") for each in (tmp_path / "again").rglob("*") if each.is_file()]
    assert len(names) > 5
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "dataset" / name).read_bytes()


def test_a_kept_episode_without_rows_has_its_commands_noted(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", refusal(2), kept=(("a", 1, 2), ("b", 10, 20)))
    (root,) = export_all([path], tmp_path / "dataset", DatasetOptions(tolerance=0))
    notes = json.loads((root / "meta/lockstep.json").read_text())
    (without,) = notes["without_rows"]
    assert without["episode"] == "a", "its only event that could be a row has no picture"
    assert without["commands"]["drivers"][0]["refused"] == {"late": 1}


def test_a_dataset_from_before_is_read_and_grows_and_its_episodes_commands_are_not_known(tmp_path: Path) -> None:
    path = driven(tmp_path / "a.mcap", kept=(("a", 2, 8), ("b", 10, 20)))
    root = tmp_path / "grown"
    append_once([path], root, DatasetOptions(), print)
    notes = json.loads((root / "meta/lockstep.json").read_text())
    for each in notes["episodes"]:
        del each["commands"]
    (root / "meta/lockstep.json").write_text(json.dumps(notes))
    assert [each.commands for each in read_state(root).notes.episodes] == [None, None]
    later = driven(tmp_path / "b.mcap", kept=(("c", 25, 30),))
    append_once([later], root, DatasetOptions(), print)
    assert [each.commands is not None for each in read_state(root).notes.episodes] == [False, False, True]
    assert verify_dataset(root).ok


def test_names_are_bounded_whatever_a_recording_says() -> None:
    tally = CommandTally(1, 9, ())
    for number in range(1000):
        record = RefusalRecord(epoch=EPOCH, event=5, refused=6, reason="late", by="robot", name=f"driver {number}")
        tally.take(record, number, NOBODY)
    commands = tally.result()
    assert len(commands.drivers) == MAX_DRIVERS + 1
    assert commands.refused == {"late": 1000}
