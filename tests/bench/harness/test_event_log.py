import json
from pathlib import Path

from lockstep.bench.harness.event_log import capture_times, robot_times


def write(path: Path, *records: dict[str, object], tail: str = "") -> Path:
    path.write_text("".join(json.dumps(record) + "\n" for record in records) + tail)
    return path


def test_the_robots_share_ends_with_the_first_feedback_of_an_event(tmp_path: Path) -> None:
    log = write(
        tmp_path / "log",
        {"kind": "feedback", "time": 0.5, "event": 1},
        {"kind": "executed", "time": 1.0, "event": 2},
        {"kind": "feedback", "time": 1.25, "event": 2},
        {"kind": "feedback", "time": 9.0, "event": 2},
        {"kind": "executed", "time": 10.0, "event": 3},
    )
    assert robot_times(log) == {2: 0.25}


def test_captures_are_those_of_one_stream(tmp_path: Path) -> None:
    log = write(
        tmp_path / "log",
        {"kind": "media", "time": 2.0, "event": 1, "stream": "overview", "captured": 1.5},
        {"kind": "media", "time": 2.1, "event": 1, "stream": "wrist", "captured": 1.6},
    )
    assert capture_times(log, "overview") == [1.5]


def test_a_line_that_is_still_being_written_is_left_for_later(tmp_path: Path) -> None:
    record: dict[str, object] = {"kind": "media", "time": 2.0, "event": 1, "stream": "overview", "captured": 1.5}
    assert capture_times(write(tmp_path / "log", record, tail='{"kind": "med'), "overview") == [1.5]
