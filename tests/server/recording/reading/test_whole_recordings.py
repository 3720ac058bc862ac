"""Which files are one episode as a whole: only where it is certain that nobody recorded by episodes."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from lockstep.server.recording.format.event_index import Ending
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.reading.scan import Scan, scan_file
from lockstep.server.recording.reading.whole_recordings import EpisodeUse, whole_recordings, why_not_whole
from lockstep.server.recording.writing.writer import RecordingWriter
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, INFO, Story
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording

PLAIN = EpisodeUse(Path("a.mcap"), "a", "none", "", False, "no_episodes")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({}, ""),
        ({"cut": "e1", "before": "begun"}, "it begins within episode e1"),
        ({"before": "begun"}, "made by episodes, as a.mcap says"),
        ({"has_records": True}, "made by episodes, as a.mcap says"),
        ({"cut": "e1"}, "it begins within episode e1"),
        ({"ending": "episodes"}, "made by episodes, as a.mcap says"),
        ({"before": ""}, "an earlier version made it"),
        ({"ending": ""}, "no file here says that its recording has ended"),
        ({"ending": "continued"}, "no file here says that its recording has ended"),
    ],
)
def test_a_file_alone_is_whole_only_if_it_says_so_itself(change: dict[str, Any], named: str) -> None:
    file = PLAIN._replace(**change)
    found = why_not_whole(file, [file])
    assert named in found
    assert bool(found) == bool(change)


def test_the_parts_of_a_recording_speak_for_each_other() -> None:
    first = PLAIN._replace(ending="continued")
    last = PLAIN._replace(path=Path("b.mcap"))
    assert why_not_whole(first, [first, last]) == why_not_whole(last, [first, last]) == ""
    used = last._replace(ending="episodes")
    assert why_not_whole(first, [first, used]) == "its recording was made by episodes, as b.mcap says"


def test_beside_episodes_of_another_recording_or_of_the_dataset_no_file_is_whole() -> None:
    other = PLAIN._replace(path=Path("b.mcap"), recording="b", has_records=True)
    assert why_not_whole(PLAIN, [PLAIN, other]) == "b.mcap has episodes, and this one has none"
    assert why_not_whole(PLAIN, [PLAIN], "blocks") == "blocks has episodes, and this one has none"


def test_other_parts_are_found_beside_the_file_by_what_they_say_and_not_by_their_names(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=10).write(path)
    (tmp_path / "broken.mcap").write_bytes(b"no recording")
    assert whole_recordings([path], wanted=False) == {path: ""}
    recording(tmp_path / "z.mcap", *KEPT_AND_NOT)  # of the same recording
    assert "z.mcap says" in whole_recordings([path], wanted=False)[path]
    assert whole_recordings([path], wanted=True) == {path: ""}


def test_a_file_of_an_earlier_version_and_an_interrupted_one_are_not_whole(tmp_path: Path) -> None:
    writer = Story(events=10).write(tmp_path / "interrupted.mcap", close=False)
    writer.flush()
    writer.abandon()
    old = tmp_path / "old" / "old.mcap"
    old.parent.mkdir()
    of_earlier_version(old)
    missing = tmp_path / "missing.mcap"
    found = whole_recordings([tmp_path / "interrupted.mcap", old, missing], wanted=False)
    assert [why.partition(",")[0] for why in found.values()] == [
        "no file here says that its recording has ended without an episode",
        "an earlier version made it",
        "it cannot be read",
    ]


@pytest.mark.parametrize(
    ("change", "ending", "reads"),
    [
        ({"episodes": "begun"}, "no_episodes", False),
        ({"episodes": "none", "cut": "e1"}, "no_episodes", False),
        ({"episodes": ""}, "no_episodes", False),
        ({"episodes": "none"}, "episodes", False),
        ({"episodes": "none"}, "continued", True),
        ({"episodes": "none"}, "no_episodes", True),
    ],
)
def test_records_are_read_only_where_head_and_end_do_not_decide(
    change: dict[str, Any], ending: Ending, reads: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = msgspec.structs.replace(INFO, **change)
    writer = RecordingWriter(tmp_path / "a.mcap", info, DESCRIPTION, CODECS)
    for entry in Story(events=10).entries():
        writer.write(entry)
    writer.close(ending)
    read: list[Path] = []

    def counted(path: Path, info: RecordingInfo) -> Scan:
        read.append(path)
        return scan_file(path, info)

    monkeypatch.setattr("lockstep.server.recording.reading.whole_recordings.scan_file", counted)
    (why,) = whole_recordings([tmp_path / "a.mcap"], wanted=False).values()
    assert bool(read) == reads
    assert (why == "") == (reads and ending == "no_episodes")


def test_the_records_of_a_file_of_an_earlier_version_count_for_the_others(tmp_path: Path) -> None:
    """Its index says that it has no episode."""
    Story(events=10).write(tmp_path / "a.mcap")
    info = RecordingInfo(recording="old", epoch=EPOCH)
    writer = RecordingWriter(tmp_path / "old.mcap", info, DESCRIPTION, CODECS)
    entries = [*Story(events=60, real=False).entries(), *KEPT_AND_NOT[:2]]
    for entry in sorted(entries, key=lambda each: each.arrived):
        writer.write(entry)
    writer.flush()
    writer._builder.index.counts.clear()
    writer._builder.index.episodes.clear()
    writer.close()
    found = whole_recordings([tmp_path / "a.mcap", tmp_path / "old.mcap"], wanted=False)
    assert found[tmp_path / "a.mcap"] == "old.mcap has episodes, and this one has none"


@pytest.mark.parametrize("part", ["", "counts", "topics", "chunks"])
def test_an_index_cannot_hide_an_episode(tmp_path: Path, part: str) -> None:
    """As one that somebody has edited."""
    writer = RecordingWriter(
        tmp_path / "a.mcap", RecordingInfo(recording="r", epoch=EPOCH, episodes="none"), DESCRIPTION, CODECS
    )
    for entry in sorted([*Story(events=60, real=False).entries(), *KEPT_AND_NOT[:2]], key=lambda each: each.arrived):
        writer.write(entry)
    writer.flush()
    index = writer._builder.index
    if part:
        index.counts.clear()
        index.episodes.clear()
    if part in ("topics", "chunks"):
        getattr(index, part).clear()
    writer.close("no_episodes")
    (why,) = whole_recordings([tmp_path / "a.mcap"], wanted=False).values()
    assert why == "its recording was made by episodes, as a.mcap says"


def test_a_file_that_is_broken_before_its_end_is_not_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, msgspec.structs.replace(INFO, episodes="none"), DESCRIPTION, CODECS)
    for entry in sorted([*Story(events=60, real=False).entries(), *KEPT_AND_NOT[:2]], key=lambda each: each.arrived):
        writer.write(entry)
        writer.flush()
    index = writer._builder.index
    index.counts.clear()
    index.episodes.clear()
    writer.close("no_episodes")
    with path.open("r+b") as file:
        file.seek(index.chunks[1].offset)
        file.write(b"\x7f")  # no opcode of a record that readers know
    (why,) = whole_recordings([path], wanted=False).values()
    assert why == "it cannot be read"


def of_earlier_version(path: Path) -> None:
    info = RecordingInfo(recording="old", epoch=EPOCH)
    assert {"episodes", "cut"}.isdisjoint(info.metadata())  # else its signature would no longer fit
    writer = RecordingWriter(path, info, DESCRIPTION, CODECS)
    for entry in Story(events=10).entries():
        writer.write(entry)
    writer.close()
