"""Whatever happens in a session, all ways to a dataset give exactly the kept episodes, and never a part of another."""

import shutil
import tempfile
from itertools import count, groupby
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.server.cli.recordings.follow import append_once
from lockstep.server.recording.dataset.appending import is_dataset, read_state
from lockstep.server.recording.dataset.follower import DatasetFollower
from lockstep.server.recording.dataset.recorded_episode import episode_of_recording
from lockstep.server.recording.errors import DatasetRefused, RecordingDamaged
from lockstep.server.recording.export.export_lerobot import DatasetOptions, export_all
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.dataset.written_session import Range, WrittenSession

STEPS = ("drive", "start", "keep", "discard", "redo", "rollover", "epoch")


def do(session: WrittenSession, step: str) -> None:
    match step:
        case "drive":
            session.drive()
        case "start" | "redo":
            session.start()
        case "keep":
            session.end("kept")
        case "discard":
            session.end("discarded")
        case "rollover":
            session.rollover()
        case "epoch":
            session.epoch()


def written(directory: Path, *steps: str, recording: str = "r") -> WrittenSession:
    directory.mkdir()
    session = WrittenSession(directory, recording)
    for step in steps:
        do(session, step)
    session.close()
    return session


def ranges_of(root: Path) -> list[Range]:
    """The epoch and the events of each episode, by its rows: the last event makes no row."""
    if not is_dataset(root):
        return []
    assert verify_dataset(root).ok
    notes = read_state(root).notes.episodes
    rows = [row for path in sorted(root.glob("data/*/*.parquet")) for row in pq.read_table(path).to_pylist()]
    found = []
    for number, group in groupby(rows, key=lambda row: row["episode_index"]):
        events = [row["lockstep.event"] for row in group]
        assert events == list(range(events[0], events[-1] + 1))
        found.append((notes[number].epoch, events[0], events[-1] + 1))
    return found


def exported(paths: list[Path], root: Path, said: list[str] | None = None, *, whole: bool = False) -> list[Range]:
    try:
        export_all(paths, root, DatasetOptions(whole=whole), say=(said if said is not None else []).append)
    except RecordingDamaged as error:
        if "there is no kept episode" not in str(error):
            raise
    return ranges_of(root)


def appended(paths: list[Path], root: Path, said: list[str] | None = None) -> list[Range]:
    append_once(paths, root, DatasetOptions(), (said if said is not None else []).append)
    return ranges_of(root)


def replayed(path: Path) -> list[tuple[int, int]]:
    """The events of each episode that a robot would be driven along: its actions say those that follow them."""
    found: list[tuple[int, int]] = []
    for number in count():
        try:
            events = [round(1000 * values[0]) - 1 for values in episode_of_recording(path, number).actions]
        except DatasetRefused:
            return found
        found.append((events[0], events[-1] + 1))
    raise AssertionError


@settings(max_examples=12, deadline=None)
@given(st.lists(st.sampled_from(STEPS), max_size=9), st.booleans())
def test_export_append_follow_and_replay_give_exactly_the_kept_episodes(steps: list[str], fails: bool) -> None:
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        (place / "recordings").mkdir()
        session = WrittenSession(place / "recordings")
        follower = DatasetFollower(place / "followed", DatasetOptions(), lambda text: None)
        for step in steps:
            do(session, step)
            follower.look(session.paths)
        session.fail() if fails else session.close()
        follower.look(session.paths)
        paths = session.paths
        by_episodes = bool({"start", "redo"} & set(steps))
        assert ranges_of(place / "followed") == session.kept
        whole = exported(paths, place / "exported")
        assert appended(paths, place / "appended") == whole
        assert [each for path in paths for each in replayed(path)] == [each[1:] for each in whole]
        one_by_one = [exported([path], place / f"one-{path.stem}") for path in paths]
        assert [each for found in one_by_one for each in found] == whole
        if by_episodes or fails:
            assert whole == session.kept
        else:
            assert len(whole) == len(paths)
        for path in paths:  # also where no other part is there
            moved = place / f"moved-{path.stem}"
            moved.mkdir()
            alone = exported([Path(shutil.copy(path, moved))], moved / "dataset")
            assert set(alone) <= set(whole)


def test_a_take_that_outgrows_its_file_and_is_discarded_is_in_no_dataset_in_any_of_its_parts(tmp_path: Path) -> None:
    session = written(tmp_path / "r", "start", "rollover", "rollover", "discard", "drive")
    assert len(session.paths) == 3
    said: list[str] = []
    assert exported(session.paths[1:], tmp_path / "dataset", said) == []
    assert [line.partition(":")[0] for line in said] == ["r-p2.mcap is left out", "r-p3.mcap is left out"]
    assert all("it begins within episode e0" in line and "--whole takes it" in line for line in said)
    assert len(exported(session.paths[1:], tmp_path / "wanted", said, whole=True)) == 2
    assert said[-2:] == [
        f"{name} has no episodes and is one as a whole, with the task 'teleoperation'"
        for name in ("r-p2.mcap", "r-p3.mcap")
    ]
    with pytest.raises(RecordingDamaged, match="r-p3.mcap is left out"):
        export_all(session.paths[2:], tmp_path / "none")
    with pytest.raises(DatasetRefused, match="it begins within episode e0"):
        episode_of_recording(session.paths[1], 0)


def test_what_lies_between_episodes_or_behind_a_restart_of_the_bridge_is_in_no_dataset(tmp_path: Path) -> None:
    session = written(tmp_path / "r", "drive", "rollover", "start", "keep", "rollover", "drive", "epoch", "drive")
    first, second, *rest = session.paths
    assert len(rest) == 2
    for path in (first, *rest):
        assert exported([path], tmp_path / f"of-{path.stem}") == []
        assert appended([path], tmp_path / f"on-{path.stem}") == []
        assert replayed(path) == []
    assert exported([second], tmp_path / "kept") == session.kept


def test_a_recording_without_episodes_is_one_as_a_whole_unless_it_comes_with_one_that_has_some(tmp_path: Path) -> None:
    (plain,) = written(tmp_path / "a", "drive", recording="plain").paths
    other = written(tmp_path / "b", "start", "keep", recording="other")
    said: list[str] = []
    assert exported([plain], tmp_path / "one", said) == [("1", 1, 6)]
    assert said == ["plain.mcap has no episodes and is one as a whole, with the task 'teleoperation'"]
    assert appended([plain], tmp_path / "two") == [("1", 1, 6)]
    assert exported([plain, *other.paths], tmp_path / "three", said) == other.kept
    assert "other.mcap has episodes, and this one has none" in said[-1]
    assert appended(other.paths, tmp_path / "four") == other.kept
    assert appended([plain], tmp_path / "four", said) == other.kept
    assert said[-2:] == [
        "plain.mcap is left out: it has no episodes, and four has episodes, and this one has none; "
        "--whole takes it as one episode all the same",
        "0 appended, 1 left out",
    ]


def test_a_follower_says_that_a_recording_without_episodes_is_left_out(tmp_path: Path) -> None:
    session = written(tmp_path / "r", "drive")
    said: list[str] = []
    follower = DatasetFollower(tmp_path / "dataset", DatasetOptions(), said.append)
    assert [follower.look(session.paths), follower.look(session.paths)] == [0, 0]
    (line,) = said
    assert line == (
        "r.mcap is left out: it has no episodes, and what is followed are kept episodes alone; "
        "--append takes it, or says why not"
    )


def test_a_follower_forgets_a_recording_that_was_deleted(tmp_path: Path) -> None:
    """Seen from outside: of a file of that name that comes later everything is said again."""
    session = written(tmp_path / "r", "drive")
    (path,) = session.paths
    other = written(tmp_path / "other", "drive", recording="other").paths
    said: list[str] = []
    follower = DatasetFollower(tmp_path / "dataset", DatasetOptions(), said.append)
    follower.look([path, *other])
    follower.look(other)
    follower.look([path, *other])
    assert len(said) == 2, "it was there all the time"
    content = path.read_bytes()
    for named in ([path, *other], other):  # the process was told the file's name, or a folder
        path.unlink()
        follower.look(named)
        path.write_bytes(content)
        said.clear()
        follower.look([path, *other])
        assert [line.partition(" ")[0] for line in said] == ["r.mcap"]


def test_an_append_reads_what_the_dataset_has_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = written(tmp_path / "r", "start", "keep")
    appended(session.paths, tmp_path / "dataset")
    read: list[str] = []
    read_bytes = Path.read_bytes

    def counted(path: Path) -> bytes:
        read.append(path.name)
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", counted)
    append_once(session.paths, tmp_path / "dataset", DatasetOptions(), lambda text: None)
    assert read.count("lockstep.json") == 1
