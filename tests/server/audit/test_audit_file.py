import os
from pathlib import Path

import msgspec
import pytest

from lockstep.protocol.files.regular_file import MAX_LINE
from lockstep.server.audit.audit_file import AuditFile, chained_lines, last_records, rotated, stored_records
from lockstep.server.audit.records import AuditRecord
from lockstep.server.evidence.chain import check_chain, line_hash


def _record(n: int, detail: str = "") -> AuditRecord:
    return AuditRecord(n=n, time=1.0, kind="note", detail=detail)


def _numbers(path: Path) -> list[int]:
    return [record.n for record in stored_records(path)]


def _file(path: Path, max_bytes: int = 10_000, files: int = 3) -> AuditFile:
    return AuditFile(path, max_bytes, files)


def test_records_are_appended_over_restarts_and_only_the_owner_can_read_them(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    for n in (1, 2):
        file = _file(path)
        file.write([_record(n), _record(n + 10)])
        file.close()
        file.close()
    assert _numbers(path) == [1, 11, 2, 12]
    assert path.stat().st_mode & 0o777 == 0o600
    first, second, *_ = path.read_bytes().splitlines()
    assert first == b'{"n":1,"time":1.0,"kind":"note","before":"%s"}' % (b"0" * 64), "what is empty is left out"
    assert second.endswith(b',"before":"%s"}' % line_hash(first).encode())


def test_a_full_file_is_set_aside_and_the_oldest_goes(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path, max_bytes=400, files=3)
    for n in range(1, 41):
        file.write([_record(n)])
    file.close()
    sizes = [rotated(path, number).stat().st_size for number in range(3)]
    assert all(size <= 400 for size in sizes)
    assert not rotated(path, 3).exists()
    numbers = _numbers(path)
    assert numbers == list(range(numbers[0], 41)), "in order, without gaps"
    assert numbers[0] > 1


def test_one_file_is_enough(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path, max_bytes=100, files=1)
    for n in range(1, 10):
        file.write([_record(n)])
    file.close()
    assert _numbers(path)[-1] == 9
    assert os.listdir(tmp_path) == ["audit.jsonl"]


def test_a_line_that_was_cut_off_does_not_spoil_the_next(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    path.write_text('{"n":1,"time":1.0,"kind":"note"}\n{"n":2,"ti')
    file = _file(path)
    file.write([_record(3)])
    file.close()
    assert _numbers(path) == [1, 3]


def test_a_write_that_fails_leaves_nothing_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path)
    file.write([_record(1)])
    whole = path.read_bytes()
    real = os.write

    def full(handle: int, data: bytes) -> int:
        if len(data) > 20:
            return real(handle, data[:20])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.write", full)
    with pytest.raises(OSError, match="No space left"):
        file.write([_record(2)])
    assert path.read_bytes() == whole
    monkeypatch.undo()
    file.write([_record(2)])
    file.close()
    assert _numbers(path) == [1, 2]


def test_what_cannot_be_understood_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    path.write_bytes(b'rubbish\n{"n":"x"}\n\xff\n{"n":5,"time":1.0,"kind":"note","unknown":1}\n')
    assert _numbers(path) == [5]
    assert [record.n for record in last_records(path)] == [5]


def test_the_end_of_the_log_is_found_quickly_and_a_missing_log_is_empty(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    assert last_records(path) == []
    assert _numbers(path) == []
    file = _file(path, max_bytes=3_000_000)
    for first in range(1, 20_001, 1000):
        file.write([_record(n, "x" * 80) for n in range(first, first + 1000)])
    file.close()
    found = [record.n for record in last_records(path)]
    assert found[-1] == 20_000
    assert 5_000 < len(found) < 20_000


def test_the_chain_goes_on_over_rotation_restarts_and_a_line_that_was_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    for first in range(1, 61, 20):
        file = _file(path, max_bytes=2000, files=20)
        for n in range(first, first + 20):
            file.write([_record(n)])
        file.close()
        with path.open("a") as cut:
            cut.write('{"n":99,"ti')
    assert rotated(path, 2).exists()
    report = check_chain(chained_lines(path))
    assert (report.records, report.first, report.last, report.count) == (60, 1, 60, 0)
    assert len(report.unreadable) == 3


def test_a_log_of_an_earlier_version_is_continued_and_what_it_held_is_bound_by_the_first_new_record(
    tmp_path: Path,
) -> None:
    path = tmp_path / "audit.jsonl"
    path.write_text('{"n":1,"time":1.0,"kind":"note"}\n{"n":2,"time":1.0,"kind":"note"}\n')
    file = _file(path)
    file.write([_record(3)])
    file.close()
    report = check_chain(chained_lines(path))
    assert (report.unchained, report.count) == (2, 0)
    path.write_text(path.read_text().replace('"n":2,"time":1.0', '"n":2,"time":2.0'))
    assert check_chain(chained_lines(path)).faults[0].kind == "changed"


def test_a_disk_that_is_full_at_the_start_breaks_no_chain_when_it_has_room_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path)
    file.write([_record(1)])
    file.close()
    with path.open("a") as cut:
        cut.write('{"n":99,"ti')
    file = _file(path)

    def full(handle: int, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr("os.write", full)
        for _ in range(2):
            with pytest.raises(OSError, match="No space left"):
                file.write([_record(2)])
    file.write([_record(2)])
    file.close()
    report = check_chain(chained_lines(path))
    assert (report.records, report.first, report.last, report.count) == (2, 1, 2, 0)


def test_while_the_end_of_the_log_cannot_be_read_nothing_begins_another_chain(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path)
    file.write([_record(1)])
    file.close()
    file = _file(path)
    with monkeypatch.context() as disk:
        disk.setattr("lockstep.server.audit.audit_file._last_lines", _unreadable)
        assert last_records(path) == []
        for _ in range(2):
            with pytest.raises(OSError, match="Input/output error"):
                file.write([_record(2)])
    file.write([_record(2)])
    file.close()
    assert check_chain(chained_lines(path)).count == 0


def _unreadable(path: Path) -> list[tuple[AuditRecord, bytes]]:
    raise OSError(5, "Input/output error")


def test_a_log_that_somebody_moves_deletes_or_replaces_meanwhile_is_written_again_behind_what_was_written(
    tmp_path: Path,
) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path)
    file.write([_record(1), _record(2)])
    path.rename(tmp_path / "moved")
    path.mkdir()
    with pytest.raises(OSError, match="directory"):
        file.write([_record(3)])
    path.rmdir()
    file.write([_record(3)])
    path.unlink()
    file.write([_record(4)])
    file.close()
    assert _numbers(tmp_path / "moved") == [1, 2]
    (line,) = path.read_bytes().splitlines()
    assert _numbers(path) == [4]
    gone = msgspec.json.decode(line)["before"]
    assert gone not in ("0" * 64, line_hash((tmp_path / "moved").read_bytes().splitlines()[-1])), "record 3 is missed"


def test_what_somebody_puts_beside_it_is_neither_waited_for_nor_taken_for_a_number(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path)
    file.write([_record(1), _record(2)])
    file.close()
    for name in ("audit.jsonl.\N{SUPERSCRIPT TWO}", "audit.jsonl.00", "audit.jsonl.x"):
        (tmp_path / name).write_bytes(b"{}\n")
    assert [line.place.line for line in chained_lines(path)] == [1, 2]
    os.mkfifo(rotated(path, 1))
    with pytest.raises(OSError, match="not a regular file"):
        list(chained_lines(path))


def test_a_line_without_an_end_takes_no_more_memory_than_a_line_may(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    file = _file(path)
    file.write([_record(1)])
    file.close()
    with path.open("ab") as log:
        log.write(b"x" * (5 * MAX_LINE) + b"\n")
    file = _file(path, max_bytes=100 * MAX_LINE)
    file.write([_record(2)])
    file.close()
    assert max(len(line.data) for line in chained_lines(path)) == MAX_LINE
    report = check_chain(chained_lines(path))
    assert (report.records, report.unreadable) == (2, ["audit.jsonl:2"])
