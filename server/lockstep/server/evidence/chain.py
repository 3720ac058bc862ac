"""Checks chains of lines, each of which carries the hash of the line before. No I/O, no clock.

The canonical bytes of a line are the bytes of the file, without the line's end. The first line carries `GENESIS`.
"""

import hashlib
from collections.abc import Iterable
from typing import Literal, NamedTuple

import msgspec

__all__ = ["GENESIS", "ChainReport", "ChainedLine", "Fault", "Place", "check_chain", "line_hash"]

GENESIS = "0" * 64
MOST = 100  # faults that are kept

FaultKind = Literal["changed", "reordered", "unchained", "cut", "anchor"]


class Place(NamedTuple):
    """The position of a line."""

    file: str
    line: int  # from 1 on

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


class ChainedLine(NamedTuple):
    place: Place
    data: bytes  # without the end of the line


class Fault(msgspec.Struct, frozen=True):
    """A difference from what was written."""

    kind: FaultKind
    n: int  # of the record
    text: str


class ChainReport(msgspec.Struct, kw_only=True):
    """The result of a check. `hashes` are those of the records that are kept, by number."""

    records: int = 0
    first: int = 0  # number of the oldest record; 0 without records
    last: int = 0
    head: str = GENESIS  # hash of the last line
    earlier: bool = False  # records before the first are not kept any more
    unchained: int = 0  # records of a version without a chain, in front of all others
    unreadable: list[str] = []  # places of lines that are not records: a write was cut off
    faults: list[Fault] = []
    count: int = 0  # of faults; only the first are kept
    hashes: dict[int, str] = {}

    def fault(self, kind: FaultKind, n: int, text: str) -> None:
        self.count += 1
        if len(self.faults) < MOST:
            self.faults.append(Fault(kind, n, text))


class _Link(msgspec.Struct):
    n: int
    before: str = ""


_decoder = msgspec.json.Decoder(_Link)


def line_hash(line: bytes) -> str:
    """SHA-256 (FIPS 180-4) of the canonical bytes, in hexadecimal digits."""
    return hashlib.sha256(line).hexdigest()


def check_chain(lines: Iterable[ChainedLine]) -> ChainReport:
    """Check the lines of one file and of those that were rotated before it, oldest first."""
    report = ChainReport()
    numbers: dict[str, int] = {}  # of the records seen, by hash
    chained = False
    for place, data in lines:
        try:
            link = _decoder.decode(data)
        except (msgspec.DecodeError, UnicodeError, RecursionError):
            if len(report.unreadable) < MOST:
                report.unreadable.append(str(place))
            continue
        if not report.records:
            _begin(report, link)
        elif link.before and link.before != report.head:
            _say_broken(report, numbers, link, place)
        elif link.before and link.n <= report.last:
            report.fault("reordered", link.n, f"{place}: record {link.n} comes after record {report.last}")
        if link.before:
            chained = True
        elif chained:
            report.fault("unchained", link.n, f"{place}: record {link.n} has no hash of the record before")
        else:
            report.unchained += 1
        report.records += 1
        report.last, report.head = link.n, line_hash(data)
        numbers[report.head] = link.n
        report.hashes[link.n] = report.head
    return report


def _begin(report: ChainReport, link: _Link) -> None:
    report.first, report.earlier = link.n, bool(link.before) and link.before != GENESIS
    if report.earlier and report.unreadable:
        text = f"{report.unreadable[0]} is not a record, but has the place of the record before {link.n}"
        report.fault("changed", link.n, text)


def _say_broken(report: ChainReport, numbers: dict[str, int], link: _Link, place: Place) -> None:
    if link.n <= report.last:
        text = f"{place}: record {link.n} comes after record {report.last}: the order was changed"
        report.fault("reordered", link.n, text)
    elif link.before in numbers:
        text = f"{place}: record {link.n} was written after record {numbers[link.before]}, not after {report.last}"
        report.fault("reordered", link.n, text)
    else:
        text = (
            f"{place}: record {link.n} does not fit record {report.last} before it: that record was changed, "
            "or records between them were removed"
        )
        report.fault("changed", link.n, text)
