import threading
from collections.abc import Callable

import pytest

from lockstep.server.audit.audit_writer import MAX_WAITING, AuditWriter
from lockstep.server.audit.records import AuditRecord
from tests.waiting import PATIENCE


class FakeFile:
    """Records what is written; full while `full` is set, stuck while `go` is not."""

    def __init__(self) -> None:
        self.written: list[int] = []
        self.full = False
        self.go = threading.Event()
        self.go.set()
        self.closed = False
        self.settled: list[int] = []  # how much was written, each time that nothing waited
        self.attempted = threading.Event()

    def write(self, records: list[AuditRecord]) -> None:
        self.attempted.set()
        self.go.wait(PATIENCE)
        if self.full:
            raise OSError(28, "No space left on device")
        self.written += [record.n for record in records]

    def settle(self) -> None:
        self.settled.append(len(self.written))

    def close(self) -> None:
        self.closed = True


class Told:
    """What the writer said, and a way to wait for it."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self._news = threading.Condition()

    def __call__(self, trouble: str) -> None:
        with self._news:
            self.said.append(trouble)
            self._news.notify_all()

    def until(self, said: list[str]) -> None:
        with self._news:
            assert self._news.wait_for(lambda: self.said == said, PATIENCE), self.said


def _record(n: int) -> AuditRecord:
    return AuditRecord(n=n, time=0.0, kind="note")


@pytest.fixture
def file() -> FakeFile:
    return FakeFile()


def _writer(file: FakeFile, told: Callable[[str], None] = lambda _: None) -> AuditWriter:
    writer = AuditWriter(file, told, retry_seconds=0.01)
    writer.start()
    return writer


def test_everything_is_written_in_order_before_it_closes(file: FakeFile) -> None:
    writer = _writer(file)
    for n in range(100):
        writer.append(_record(n))
    writer.close()
    writer.close()
    assert file.written == list(range(100))
    assert (file.closed, writer.lost, writer.failures) == (True, 0, 0)


def test_when_nothing_waits_the_file_may_settle_what_it_has(file: FakeFile) -> None:
    told = Told()
    file.full = True
    writer = _writer(file, told)
    writer.append(_record(1))
    told.until(["No space left on device"])
    assert file.settled == [], "what waits is written first"
    file.full = False
    told.until(["No space left on device", ""])
    writer.close()
    assert set(file.settled) == {1}


def test_a_full_disk_is_told_once_and_nothing_is_lost_when_there_is_room_again(file: FakeFile) -> None:
    told = Told()
    file.full = True
    writer = _writer(file, told)
    writer.append(_record(1))
    told.until(["No space left on device"])
    writer.append(_record(2))
    file.full = False
    told.until(["No space left on device", ""])
    writer.close()
    assert file.written == [1, 2]
    assert writer.failures >= 1
    assert writer.lost == 0


def test_what_can_never_be_written_is_counted(file: FakeFile) -> None:
    file.full = True
    writer = _writer(file)
    for n in range(3):
        writer.append(_record(n))
    writer.close()
    assert (file.written, writer.lost) == ([], 3)


def test_a_stuck_disk_delays_nobody_and_the_queue_is_bounded(file: FakeFile) -> None:
    file.go.clear()
    writer = _writer(file)
    writer.append(_record(0))
    assert file.attempted.wait(PATIENCE)
    for n in range(1, MAX_WAITING + 11):
        writer.append(_record(n))
    assert writer.lost == 10
    file.go.set()
    writer.close()
    assert file.written == list(range(MAX_WAITING + 1))


def test_while_the_disk_is_full_every_record_is_written_later_or_counted_as_lost(file: FakeFile) -> None:
    told = Told()
    file.full = True
    writer = _writer(file, told)
    for n in range(3 * MAX_WAITING):
        writer.append(_record(n))
    told.until(["No space left on device"])
    file.full = False
    told.until(["No space left on device", ""])
    writer.close()
    assert writer.lost > 0
    assert len(file.written) + writer.lost == 3 * MAX_WAITING
    assert file.written == sorted(file.written)


def test_a_record_that_no_file_can_hold_is_told_and_the_thread_goes_on(
    file: FakeFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    told, write = Told(), file.write

    def broken(records: list[AuditRecord]) -> None:
        raise ValueError("surrogates not allowed")

    monkeypatch.setattr(file, "write", broken)
    writer = _writer(file, told)
    writer.append(_record(1))
    told.until(["surrogates not allowed"])
    monkeypatch.setattr(file, "write", write)
    told.until(["surrogates not allowed", ""])
    writer.close()
    assert file.written == [1]
