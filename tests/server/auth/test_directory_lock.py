"""One thread at a time, and what the others see of it."""

import threading
from pathlib import Path

from lockstep.server.auth.directory_lock import DirectoryLock
from lockstep.server.util.state_dir import StateDir


def test_a_thread_that_holds_it_is_seen_and_not_waited_for(tmp_path: Path) -> None:
    lock, held, ends = DirectoryLock(StateDir(tmp_path)), threading.Event(), threading.Event()

    def hold() -> None:
        with lock.held():
            held.set()
            ends.wait(10)

    thread = threading.Thread(target=hold)
    assert lock.seconds_held < 0
    thread.start()
    try:
        assert held.wait(10)
        assert lock.seconds_held >= 0
        with lock.unless_held() as is_free:
            assert not is_free
    finally:
        ends.set()
        thread.join(10)
    assert lock.seconds_held < 0
    for _ in range(2):
        with lock.unless_held() as is_free:
            assert is_free
