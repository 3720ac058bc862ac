import json
import queue
import threading
from pathlib import Path

import pytest

from lockstep.robot_bridge import event_log
from lockstep.robot_bridge.event_log import EventLog


def test_lines_are_appended_in_order_and_complete_after_close(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    path.write_text('{"kind":"older"}\n')
    log = EventLog(path)
    log.record("start", 1)
    log.open()
    log.record("executed", 2, at=1.5, values=[0.5])
    log.record("media", 2, at=1.6, stream="a", captured=1.55)
    log.close()
    log.close()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert lines == [
        {"kind": "older"},
        {"kind": "executed", "time": 1.5, "event": 2, "values": [0.5]},
        {"kind": "media", "time": 1.6, "event": 2, "stream": "a", "captured": 1.55},
    ]
    assert not any(thread.name == "event-log" for thread in threading.enumerate())


def test_a_path_that_cannot_be_opened_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file"):
        EventLog(tmp_path / "missing" / "log.jsonl").open()


def test_what_does_not_fit_is_counted_and_never_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = EventLog(tmp_path / "log.jsonl")
    log.open()

    def full(item: object) -> None:
        raise queue.Full

    with monkeypatch.context() as patched:
        patched.setattr(log._waiting, "put_nowait", full)
        log.record("executed", 1)
    log.close()
    assert log.dropped == 1
    assert event_log.MAX_WAITING > 1000


def test_a_disk_that_fails_stops_the_log_and_not_the_bridge() -> None:
    log = EventLog(Path("/dev/full"))
    log.open()
    for event in range(1, 5):
        log.record("executed", event)
    log.close()


def test_a_log_without_a_file_records_nothing_and_has_no_thread() -> None:
    log = EventLog(None)
    log.open()
    log.record("executed", 1)
    log.close()
    assert not any(thread.name == "event-log" for thread in threading.enumerate())
