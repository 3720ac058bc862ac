"""The page of a session or a dataset: its figures, its pictures, and that nothing in a file gets out of its place."""

import re
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import pytest
from typer.testing import CliRunner

from lockstep.server.cli.main import app
from lockstep.server.recording.episodes.edits import EpisodeEdit, add_edit
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.format.records import Degraded, RefusalRecord, RobotRecord, SeatRecord
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.reading import session_parts
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.report.dataset_page import dataset_page
from lockstep.server.recording.report.page import session_page
from lockstep.server.recording.report.session import read_session
from lockstep.server.recording.report.totals import Totals
from lockstep.server.recording.writing.writer import Entry
from tests.server.recording.makers import DESCRIPTION, EPOCH, INFO, INTERVAL, START, Story, own_entry, rewritten
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording

OTHER_EPOCH = "ffee"
LATER = 60 * 1_000_000_000  # ns


class _Checked(HTMLParser):
    """Tags that load or run something, and whether all are closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.sources += [value or "" for name, value in attributes if name in ("src", "href", "xlink:href")]
        if tag not in ("meta", "img", "rect", "line"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in ("rect", "line"):
            assert self.open.pop() == tag


def checked(text: str) -> _Checked:
    parser = _Checked()
    parser.feed(text)
    assert parser.open == []
    assert "script" not in parser.tags
    assert all(each.startswith("data:image/jpeg;base64,") for each in parser.sources)
    assert "http://" not in text.replace("http://www.w3.org/", "")
    return parser


def _at(event: int) -> int:
    return START + (event - 1) * INTERVAL + 20_000_000


def refusal(event: int, detail: str = "") -> Entry:
    record = RefusalRecord(
        epoch=EPOCH, event=event, refused=event + 1, reason="late", detail=detail, by="robot", name="Ada"
    )
    return own_entry(record, _at(event))


def parts(folder: Path) -> tuple[Path, Path]:
    """A session whose robot's bridge was restarted: two files, of another epoch each."""
    first = recording(folder / "s.mcap", refusal(30), events=50)
    info = msgspec.structs.replace(INFO, part=2, epoch=OTHER_EPOCH, episodes="none")
    later = [each._replace(arrived=each.arrived + LATER, captured=each.captured + LATER) for each in _again()]
    return first, rewritten(folder / "s-p2.mcap", later, lambda each: [each], info=info)


def _again() -> list[Entry]:
    return sorted([*Story(events=40, real=True).entries(), refusal(20, "again")], key=lambda each: each.arrived)


def test_a_session_of_several_files_is_told_as_one(tmp_path: Path) -> None:
    first, second = parts(tmp_path)
    text = session_page(first)
    assert len(checked(text).sources) == 3, "of the refusal in each file, and of when pictures came again"
    assert re.search(r"none of front for 5\d\.\d s", text)
    plain = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", text))
    assert " 88 events, 88 commands, 264 pictures and sounds. In 2 files." in plain
    assert " 61.6 s, " in plain, "from the begin of the first to the end of the last"
    assert "late 2 " in plain
    assert "In 2 files" not in session_page(second), "a later part by itself"
    assert "In 2 files" not in session_page(first, alone=True)
    assert read_session(first).seconds == pytest.approx(61.6, abs=0.1)


def test_a_part_of_another_robot_is_told_by_its_own_description(tmp_path: Path) -> None:
    first, second = parts(tmp_path)
    (front,) = DESCRIPTION.cameras
    slow = msgspec.structs.replace(front, frame_rate=0.5)
    turned = msgspec.structs.replace(DESCRIPTION, axes=tuple(reversed(DESCRIPTION.axes)), cameras=(slow,))
    info = msgspec.structs.replace(INFO, part=2, epoch=OTHER_EPOCH, episodes="none")
    later = [each._replace(arrived=each.arrived + LATER, captured=each.captured + LATER) for each in _again()]
    plain = read_session(first)
    second.unlink()

    def described(entry: Entry) -> list[Entry]:
        if not isinstance(entry.record, RobotRecord):
            return [entry]
        record = msgspec.structs.replace(entry.record, description=turned)
        return [own_entry(record, entry.arrived, entry.captured)]

    rewritten(second, later, described, turned, info)
    session = read_session(first)
    assert [axis.name for axis in session.description.axes] == ["base.vx", "base.wz"]
    at = len(session.measured["base.vx"].values) - 10
    assert session.measured["base.vx"].values[at] == plain.measured["base.wz"].values[at]
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", session_page(first)))
    assert re.search(r"front \d+ 25\.0 0\.5 1 5\d\.\d 0 0 ", text), "no picture is of an event of the file before"


def test_a_file_that_is_too_large_with_the_others_or_still_written_is_told_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = parts(tmp_path)
    monkeypatch.setattr(session_parts, "MOST_BYTES", first.stat().st_size + 1)
    (words,) = session_parts.session_parts(first).left_out
    assert words == f"{second.name} is told by itself, since all together are too large"
    monkeypatch.undo()
    monkeypatch.setattr(session_parts, "is_written", lambda path: path == second)
    assert session_parts.session_parts(first) == ([first], [f"{second.name} is still being written"])


def test_a_part_that_cannot_be_read_is_named_and_a_file_of_another_session_is_none(tmp_path: Path) -> None:
    first, second = parts(tmp_path)
    other = msgspec.structs.replace(INFO, recording="another", part=3)
    rewritten(tmp_path / "s-p3.mcap", Story(events=10, real=True).entries(), lambda each: [each], info=other)
    second.write_bytes(b"\x89MCAP0\r\n" + bytes(90))
    text = session_page(first)
    assert "Without the rest: s-p2.mcap cannot be read." in text
    assert "In 2 files" not in text


def test_a_session_is_told_by_driver_and_camera_with_pictures_of_what_was_wrong(tmp_path: Path) -> None:
    lost = own_entry(Degraded(epoch=EPOCH, event=70, lost=7), _at(70))
    taken = own_entry(
        SeatRecord(epoch=EPOCH, event=50, holder="p2", name="Bo", role="supervisor", why="taken"), _at(50)
    )
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT, refusal(30), taken, lost)
    text = session_page(path)
    parser = checked(text)
    assert len(parser.sources) == 2, "of the refusal, and of what the recorder left out"
    assert "late" in text
    assert "the recorder left 7 records out" in text
    plain = re.sub(r"<[^>]+>", " ", text)
    assert re.search(r"Ada\s+", plain)
    assert re.search(r"Bo\s+supervisor", plain)
    assert re.search(r"front\s+99\s+25\.0\s+25\.0\s+0\s", plain)
    assert re.search(r"Take-overs\s+1\s", plain)
    assert re.search(r"Episodes kept\s+2 of 5", plain)


def test_the_page_has_the_changes_of_the_episodes(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    with RecordingReader(path) as reader:
        add_edit(path, episodes_of(reader), EpisodeEdit(episode="a", at=1.0, split=15))
    assert re.search(r"Episodes kept\s+3 of 6", re.sub(r"<[^>]+>", " ", session_page(path)))


def test_whatever_a_file_says_stays_text(tmp_path: Path) -> None:
    evil = "<script>alert(1)</script><img src=x onerror='y'>\"\u202e"
    path = recording(tmp_path / "a.mcap", refusal(30, evil), *KEPT_AND_NOT)
    text = session_page(path)
    checked(text)
    assert "<script" not in text
    assert "\u202e" not in text
    assert "default-src 'none'" in text


def test_a_silent_camera_and_pictures_that_cannot_be_decoded_are_no_reason_to_fail(tmp_path: Path) -> None:
    def without(each: Entry) -> list[Entry]:
        return [] if each.topic.startswith(CAMERA) and 40 <= each.event < 90 else [each]

    path = rewritten(tmp_path / "a.mcap", Story(events=120).entries(), without)
    text = session_page(path)
    assert "none of front for" in text
    assert checked(text).sources == []


def test_a_session_without_any_trouble_says_so(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", events=30)
    assert "Nothing that the recording tells of" in session_page(path)


def test_the_totals_are_bounded_whatever_comes(tmp_path: Path) -> None:
    totals = Totals(DESCRIPTION)
    for number in range(3000):
        totals.own(
            RefusalRecord(epoch=EPOCH, event=1, refused=1, reason="late", by="robot", name=f"driver {number}"),
            number * 2_000_000,
        )
        totals.picture(f"camera {number}", 1, number, number, keyframe=True)
    assert len(totals.drivers) <= 51
    assert len(totals.cameras) <= 16
    assert len(totals.moments) <= 400


def test_a_dataset_is_told_by_task_driver_and_camera_with_its_widest_rows(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT, stamps={50: 48, 51: 48})
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    text = dataset_page(root)
    parser = checked(text)
    assert len(parser.sources) == 1
    plain = re.sub(r"<[^>]+>", " ", text)
    assert re.search(r"push\s+1\s+1\s+0\s+10\s+0\s+100 %", plain)
    assert re.search(r"wipe\s+1\s+0\s+1\s+15\s+0\s+0 %", plain)
    assert "gap of 3: event 51" in plain


@pytest.mark.parametrize("option", ["--html", "--out"])
def test_the_command_writes_the_page_of_a_recording_and_of_a_dataset(tmp_path: Path, option: str) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    (root,) = export_lerobot.export(path, tmp_path / "dataset", "")
    environment = {"LOCKSTEP_STATE_DIR": str(tmp_path / "state")}
    for source, words in ((path, "Promises"), (root, "The rows with the largest gaps")):
        target = tmp_path / f"{source.name}.html"
        done = CliRunner().invoke(app, ["report", str(source), option, str(target)], env=environment)
        assert done.exit_code == 0, done.output
        assert words in target.read_text()
