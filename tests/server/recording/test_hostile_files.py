"""Recordings that somebody else has made: names lead nowhere, words are only printed, and chunks unpack small."""

import csv
import os
import struct
from pathlib import Path

import msgspec
import pytest
import zstandard
from mcap.records import Chunk
from typer.testing import CliRunner

from lockstep.protocol.console import Report, StreamReport
from lockstep.protocol.description import Body, BodyJoint, Geofence, RangeRing
from lockstep.server.cli.main import app
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export import export_csv, export_mp4
from lockstep.server.recording.format.event_index import MAX_MARKS, EventIndex, TopicEntry, decode_index
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.records import ReportRecord, RobotRecord
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.reading.bookmarks import Mark
from lockstep.server.recording.reading.raw_records import HEAD, MAGIC, MAX_UNPACKED, chunk_records
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.record_file import FOOTER
from lockstep.server.recording.reading.scan import scan_file
from lockstep.server.recording.reading.whole_recordings import whole_recordings
from lockstep.server.recording.verify.verify_file import verify_file
from lockstep.server.recording.writing.writer import Entry, RecordingWriter
from tests.server.recording.makers import CODECS, DESCRIPTION, EPOCH, INFO, Story, own_entry, rewritten

RING = RangeRing(name="r", body="base", count=3, angle_min=0.0, angle_increment=0.1, range_min=0.1, range_max=4.0)
TURN = BodyJoint(joint="x", kind="revolute", axis=(0.0, 0.0, 1.0))
HUGE = 1 << 40  # bytes, of which a hole in a file takes none
ESCAPE = "\x1b[2J\x1b[1;1H\nverified and true\n"


def _with_camera(path: Path, *names: str) -> Path:
    """A recording whose camera is called like that; of several names each has the pictures."""
    writer = RecordingWriter(path, INFO, DESCRIPTION, {**dict.fromkeys(names, "H264"), "ear": "opus"})
    for entry in Story(events=10, real=True).entries():
        if entry.topic.startswith(CAMERA):
            for name in names:
                writer.write(entry._replace(topic=CAMERA + name))
        else:
            writer.write(entry)
    writer.close()
    return path


@pytest.mark.parametrize("name", ["../../../out", "/tmp/out", "a/b", "..", "x\0y", "n" * 300])
def test_a_cameras_name_leads_to_no_other_folder(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "recordings"
    folder.mkdir(parents=True)
    (written,) = export_mp4.export(_with_camera(folder / "a.mcap", name), None, "")
    assert written.parent == folder
    assert {each for each in tmp_path.rglob("*") if each.is_file()} == {folder / "a.mcap", written}


def test_names_that_differ_in_a_slash_only_are_two_files(tmp_path: Path) -> None:
    written = export_mp4.export(_with_camera(tmp_path / "a.mcap", "left/eye", "left_eye"), None, "")
    assert len({*written}) == 2
    assert all(each.stat().st_size > 1000 for each in written)


def test_what_a_recording_says_cannot_write_to_the_terminal(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    info = RecordingInfo(recording="r", epoch=INFO.epoch, robot=ESCAPE, name=ESCAPE)
    writer = RecordingWriter(path, info, DESCRIPTION, CODECS)
    entries = Story(events=60).entries()
    for entry in entries:
        writer.write(entry)
    last = entries[-1]
    for violations in (0, 5):
        stream = StreamReport(stream="front", carrier="native", stamp=last.event, violations=violations)
        report = Report(event=last.event, streams=[stream])
        record = ReportRecord(epoch=EPOCH, event=last.event, peer="p1", name=ESCAPE, report=report)
        writer.write(own_entry(record, last.arrived))
    writer.close()
    runner = CliRunner()
    for arguments in (["recordings", "--dir", str(tmp_path)], ["verify", str(path)]):
        output = runner.invoke(app, arguments, env={"LOCKSTEP_STATE_DIR": str(tmp_path / "state")}).output
        assert "verified and true" in output, "it is shown, as the name that it is"
        assert "\x1b" not in output
        assert not any(line.startswith("verified") for line in output.splitlines())


@pytest.mark.parametrize("name", ['=HYPERLINK("http://x")', "+1", "-1", "@SUM(A1)"])
def test_a_name_is_nothing_that_a_spreadsheet_calculates(name: str, tmp_path: Path) -> None:
    def renamed(entry: Entry) -> list[Entry]:
        told = msgspec.json.encode(name)
        return [entry._replace(data=entry.data.replace(b'"Ada"', told)) if "/seat" in entry.topic else entry]

    path = rewritten(tmp_path / "a.mcap", Story(events=10).entries(), renamed)
    (written,) = export_csv.export(path, None, "")
    with written.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["driver"] for row in rows} == {f"'{name}"}
    assert float(rows[1]["axis.base.wz"]) == 0.0, "numbers stay numbers"


@pytest.mark.parametrize("unpacked", [1 << 33, 1000])
def test_a_chunk_that_unpacks_to_more_than_it_says_or_than_fits_is_not_unpacked(unpacked: int) -> None:
    bomb = zstandard.compress(bytes(64 << 20))
    assert len(bomb) < 10_000
    chunk = Chunk("zstd", bomb, 0, 0, 0, unpacked)
    with pytest.raises(ValueError, match="a chunk of"):
        chunk_records(chunk)
    honest = Chunk("zstd", zstandard.compress(b"\x99" + struct.pack("<Q", 3) + b"abc"), 0, 0, 0, 12)
    assert chunk_records(honest) == []
    large = zstandard.ZstdCompressor().compressobj(size=MAX_UNPACKED + 1)
    data = b"".join([*(large.compress(bytes(1 << 20)) for _ in range(32)), large.compress(b"\0"), large.flush()])
    with pytest.raises(ValueError, match="a chunk of"):
        chunk_records(Chunk("zstd", data, 0, 0, 0, MAX_UNPACKED + 1))
    with pytest.raises(ValueError, match="compressed as"):
        chunk_records(Chunk("lz4", b"", 0, 0, 0, 0))


@pytest.mark.parametrize("text", [b'{"started": 9007199254740992}', b'{"chunks": [[-5, 1, 1, 0, 0]]}'])
def test_an_index_of_impossible_numbers_is_damaged(text: bytes) -> None:
    with pytest.raises(RecordingDamaged):
        decode_index(text)
    assert decode_index(b"{}") == EventIndex()


@pytest.mark.parametrize(
    ("changed", "trouble"),
    [
        ({"topics": [TopicEntry(1, f"/camera/{number}", "", "") for number in range(1000)]}, "1000 topics"),
        ({"topics": [TopicEntry(1, "/camera/" + "x" * 100_000, "", "")]}, "1000 characters"),
        ({"marks": [Mark(1, 1, "note", "x")] * (MAX_MARKS + 1)}, "20001 marks"),
        ({"keyframes": {f"/camera/{number}": [] for number in range(1000)}}, "1000 topics with keyframes"),
    ],
)
def test_an_index_that_no_page_could_show_is_damaged(changed: dict[str, object], trouble: str, tmp_path: Path) -> None:
    writer = Story(events=10).write(tmp_path / "a.mcap", close=False)
    hostile = msgspec.structs.replace(writer.index(), **changed)
    writer._builder.index = hostile
    writer.close()
    with pytest.raises(RecordingDamaged, match=trouble):
        RecordingReader(tmp_path / "a.mcap")


def test_a_whole_recording_is_read_as_before(tmp_path: Path) -> None:
    Story(events=30).write(tmp_path / "a.mcap")
    with RecordingReader(tmp_path / "a.mcap") as reader:
        assert sum(1 for _ in reader.records()) > 100


@pytest.mark.parametrize("offset", [2**59, 2**63, 2**64 - 1])
def test_a_summary_that_is_said_to_be_nowhere_is_damage_and_no_other_error(offset: int, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=10).write(path)
    whole = bytearray(path.read_bytes())
    at = len(whole) - len(MAGIC) - 4 - 8  # the footer's summary_offset_start
    whole[at : at + 8] = offset.to_bytes(8, "little")
    path.write_bytes(whole)
    with pytest.raises(RecordingDamaged):
        RecordingReader(path)


@pytest.mark.parametrize(
    "changed",
    [
        {"label": "x" * 100_000},
        {"name": ESCAPE},
        {"axes": DESCRIPTION.axes * 10_000},
        {"ranges": msgspec.structs.replace(RING, count=1 << 28)},
        {"ranges": msgspec.structs.replace(RING, angle_min=1e300)},
        {"bodies": (Body(name="b", parent="", position=(1e300, 0.0, 0.0)),)},
        {"ranges": msgspec.structs.replace(RING, count=-1)},
        {"geofences": (Geofence(name="f", label="F", kind="keep_in", polygon=((0.0, 0.0),) * 100_000),)},
        {"bodies": (Body(name="b", parent="", joints=(TURN,) * 100_000),)},
    ],
)
def test_a_description_that_nobody_could_show_counts_as_damage(changed: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, INFO, DESCRIPTION, CODECS)
    entries = Story(events=10).entries()
    told = RobotRecord(epoch=EPOCH, event=1, link="up", description=msgspec.structs.replace(DESCRIPTION, **changed))
    for entry in [own_entry(told, entries[0].arrived), *entries]:
        writer.write(entry)
    writer.close()
    with RecordingReader(path) as reader, pytest.raises(RecordingDamaged, match="description"):
        reader.description()


def test_a_record_in_a_file_with_holes_that_is_larger_than_memory_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = Story(events=30).write(tmp_path / "open.mcap", close=False)
    writer.flush()
    path.write_bytes((tmp_path / "open.mcap").read_bytes())
    writer.close()
    whole = path.stat().st_size
    with path.open("ab") as file:
        file.write(b"\x99" + HUGE.to_bytes(8, "little"))
    os.truncate(path, whole + HEAD + HUGE)
    with RecordingReader(path) as reader:
        assert reader.interrupted
        assert scan_file(path, reader.info).whole == whole
    verdict = verify_file(path)
    assert "the bound is" in " ".join(each.text for each in verdict.checks["readable"].violations)


def test_a_summary_in_a_file_with_holes_that_is_larger_than_memory_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=10).write(path)
    whole = path.read_bytes()
    with path.open("r+b") as file:
        file.truncate(len(whole) - FOOTER + HUGE)
        file.seek(0, os.SEEK_END)
        file.write(whole[-FOOTER:])
    with pytest.raises(RecordingDamaged, match="a summary of"):
        RecordingReader(path)


def test_a_recording_that_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.mcap")
    with pytest.raises(OSError, match="not a regular file"):
        RecordingReader(tmp_path / "a.mcap")


def test_a_recording_that_is_cut_while_it_is_read_is_damaged_from_there_on(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=200).write(path)
    with RecordingReader(path) as reader:
        assert list(reader.chunk(0))
        os.truncate(path, reader.index.chunks[-1].offset + HEAD + 1)
        with pytest.raises(RecordingDamaged):
            list(reader.records())


@pytest.mark.parametrize("field", ["recording", "epoch", "robot", "name", "by"])
def test_what_a_recording_says_of_itself_is_short(field: str, tmp_path: Path) -> None:
    info = msgspec.structs.replace(INFO, **{field: "x" * 100_000})
    RecordingWriter(tmp_path / "a.mcap", info, DESCRIPTION, CODECS).close()
    with pytest.raises(RecordingDamaged, match="not a recording of Lockstep"):
        RecordingReader(tmp_path / "a.mcap")


HUGE_TEXT = "x" * 100_000


@pytest.mark.parametrize(
    "said",
    [
        {"episodes": "maybe"},
        {"episodes": HUGE_TEXT},
        {"episodes": ESCAPE},
        {"cut": HUGE_TEXT},
        {"part": "-1"},
        {"part": "9" * 30},
        {"part": HUGE_TEXT},
        {"part": "1" * 100_000},
    ],
)
def test_impossible_words_of_a_recording_about_its_parts_and_episodes_are_damage_in_short_words(
    said: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RecordingInfo, "metadata", lambda info: {"recording": "r", "epoch": EPOCH} | said)
    path = tmp_path / "a.mcap"
    Story(events=10).write(path)
    monkeypatch.undo()
    assert_is_damaged(path, f"not a recording of Lockstep: .*{next(iter(said))}" if len(str(said)) < 1000 else "not a")


@pytest.mark.parametrize("ending", [5, None, ["continued"], {"a": 1}, 10**30, "maybe", HUGE_TEXT, ESCAPE])
def test_an_impossible_ending_in_an_index_is_damage_in_short_words(
    ending: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    writer = Story(events=10).write(path, close=False)
    writer.close(ending)  # type: ignore[arg-type]  # it is written as it is
    assert_is_damaged(path, "the index cannot be read: ")


def assert_is_damaged(path: Path, words: str) -> None:
    """Whatever reads it says so in one line."""
    with pytest.raises(RecordingDamaged, match=words) as raised:
        RecordingReader(path)
    assert len(str(raised.value)) < 1000
    assert whole_recordings([path], wanted=False) == {path: "it cannot be read"}
    out = str(path.with_name("dataset"))
    environment = {"LOCKSTEP_STATE_DIR": str(path.with_name("state"))}
    for more in ([], ["--append"], ["--whole"]):
        result = CliRunner().invoke(app, ["export", "--to", "lerobot", "--out", out, *more, str(path)], env=environment)
        assert result.exit_code == (0 if more == ["--append"] else 2), result.output
        assert isinstance(result.exception, SystemExit | None), result.output
        assert len(result.output) < 2000
        assert "\x1b" not in result.output


def test_an_episode_that_was_cut_is_named_without_what_it_would_write_to_the_terminal(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    info = msgspec.structs.replace(INFO, episodes="begun", cut=ESCAPE)
    writer = RecordingWriter(path, info, DESCRIPTION, CODECS)
    for entry in Story(events=10).entries():
        writer.write(entry)
    writer.close("no_episodes")
    arguments = ["export", "--to", "lerobot", "--out", str(tmp_path / "dataset"), str(path)]
    result = CliRunner().invoke(app, arguments, env={"LOCKSTEP_STATE_DIR": str(tmp_path / "state")})
    assert result.exit_code == 2
    assert "it begins within episode" in result.output
    assert "\x1b" not in result.output
