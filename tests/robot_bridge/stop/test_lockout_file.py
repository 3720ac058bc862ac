import threading
from pathlib import Path

import pytest

from lockstep.robot_bridge.stop.lockout_file import PATIENCE, LockoutFile, look_at


def test_a_robot_whose_file_is_not_there_is_not_locked(tmp_path: Path) -> None:
    assert look_at(tmp_path / "lockout") == ""


def test_whatever_has_the_name_locks(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    (tmp_path / "broken-link").symlink_to(tmp_path / "nowhere")
    for name in ("file", "folder", "broken-link"):
        assert look_at(tmp_path / name) == f"locked at the robot ({tmp_path / name})"


def test_what_cannot_be_looked_at_counts_as_locked(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert "folder of the lock-out file cannot be checked" in look_at(tmp_path / "missing" / "lockout")
    assert "cannot be checked" in look_at(tmp_path / "file" / "lockout")
    assert "cannot be checked" in look_at(tmp_path / ("x" * 300))


def test_before_the_first_look_the_robot_is_locked(tmp_path: Path) -> None:
    assert "not been checked yet" in LockoutFile(tmp_path / "lockout").reason


def test_a_look_that_hangs_locks_the_robot_after_a_while(tmp_path: Path) -> None:
    now = [100.0]
    looked, go_on = threading.Semaphore(0), threading.Semaphore(0)

    def look(path: Path) -> str:
        looked.release()
        go_on.acquire(timeout=30)
        return ""

    switch = LockoutFile(tmp_path / "lockout", look=look, clock=lambda: now[0])
    go_on.release()
    switch.start()
    looked.acquire(timeout=30)
    looked.acquire(timeout=30)  # the second look has begun, so the first is known
    assert switch.reason == ""
    now[0] += PATIENCE + 0.1
    assert "in time" in switch.reason
    go_on.release(2)
    switch.close()


@pytest.mark.parametrize("started", [True, False])
def test_it_can_be_closed_at_any_time(tmp_path: Path, started: bool) -> None:
    switch = LockoutFile(tmp_path / "lockout")
    if started:
        switch.start()
    switch.close()
    switch.close()
