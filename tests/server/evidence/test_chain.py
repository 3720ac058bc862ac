"""Any single change of a chained log is found; what an honest log can look like is not taken for a change."""

import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.evidence.chain import GENESIS, ChainedLine, ChainReport, Place, check_chain, line_hash

RECORDS = 12


def _lines(count: int = RECORDS) -> list[bytes]:
    lines: list[bytes] = []
    before = GENESIS
    for n in range(1, count + 1):
        lines.append(json.dumps({"n": n, "kind": "note", "detail": f"text {n}", "before": before}).encode())
        before = line_hash(lines[-1])
    return lines


def _check(lines: list[bytes]) -> ChainReport:
    return check_chain(ChainedLine(Place("audit.jsonl", number), line) for number, line in enumerate(lines, 1))


def test_an_untouched_chain_has_no_fault() -> None:
    report = _check(_lines())
    assert (report.records, report.first, report.last, report.count) == (RECORDS, 1, RECORDS, 0)
    assert not report.earlier
    assert report.head == line_hash(_lines()[-1])


@given(st.data())
def test_any_single_edit_but_of_the_last_record_is_found(data: st.DataObject) -> None:
    """The last one is not followed by a hash: a signed head finds that (test_audit_store.py)."""
    lines = _lines()
    at = data.draw(st.integers(0, RECORDS - 2))
    position = data.draw(st.integers(0, len(lines[at]) - 1))
    byte = data.draw(st.integers(0, 255).filter(lambda value: value != lines[at][position] and value != 10))
    lines[at] = lines[at][:position] + bytes([byte]) + lines[at][position + 1 :]
    assert _check(lines).count


@given(st.integers(1, RECORDS - 2), st.integers(1, 3))
def test_records_that_were_taken_out_of_the_middle_are_found(first: int, count: int) -> None:
    lines = _lines()
    del lines[first : min(first + count, RECORDS - 1)]
    report = _check(lines)
    assert report.count == 1
    assert f"record {first}" in report.faults[0].text


@given(st.lists(st.integers(0, RECORDS - 1), min_size=2, max_size=2, unique=True))
def test_two_records_that_changed_places_are_found_and_called_reordered(places: list[int]) -> None:
    lines = _lines()
    one, other = places
    lines[one], lines[other] = lines[other], lines[one]
    assert "reordered" in {fault.kind for fault in _check(lines).faults}


def test_a_number_that_comes_again_is_found_also_where_the_hashes_fit() -> None:
    lines = _lines()
    lines.append(json.dumps({"n": RECORDS, "before": line_hash(lines[-1])}).encode())
    assert [fault.kind for fault in _check(lines).faults] == ["reordered"]


@given(st.integers(0, RECORDS), st.booleans())
def test_a_record_that_was_put_in_is_found(at: int, chained: bool) -> None:
    lines = _lines()
    before = line_hash(lines[at - 1]) if at else GENESIS
    forged = {"n": at + 1, "kind": "note", **({"before": before} if chained else {})}
    lines.insert(at, json.dumps(forged).encode())
    report = _check(lines)
    assert report.count or at in (0, RECORDS)
    if at == 0 and not chained:
        assert report.count, "the first record says that nothing was in front of it"
    if at == RECORDS and not chained:
        assert report.faults[0].kind == "unchained"


def test_what_was_rotated_away_and_a_line_that_was_cut_off_are_said_and_are_no_fault() -> None:
    lines = _lines()[4:]
    lines.insert(3, b'{"n":7,"ki')
    report = _check(lines)
    assert (report.first, report.earlier, report.count) == (5, True, 0)
    assert report.unreadable == ["audit.jsonl:4"]


def test_records_without_a_hash_behind_chained_ones_are_a_fault_and_before_them_are_not() -> None:
    old = b'{"n":1,"kind":"note"}'
    new = json.dumps({"n": 2, "before": line_hash(old)}).encode()
    assert (_check([old, new]).count, _check([old, new]).unchained) == (0, 1)
    assert _check([old, new, b'{"n":3}']).faults[0].kind == "unchained"


def test_the_faults_that_are_listed_are_bounded(tmp_path: Path) -> None:
    lines = [json.dumps({"n": n, "before": "1" * 64}).encode() for n in range(1, 1000)]
    report = _check([*lines, *[b"rubbish"] * 1000])
    assert report.count > 900
    assert len(report.faults) == len(report.unreadable) == 100
