"""Checks a recording file: `lockstep verify`.

It goes by the records. An index only finds them for readers: where one says something else, the file fails.
"""

import os
import struct
import zlib
from pathlib import Path

from lockstep.protocol.files.regular_file import open_regular
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import RobotRecord
from lockstep.server.recording.format.topics import stream_of
from lockstep.server.recording.reading.raw_records import MAGIC, MAX_RECORD, raw_records
from lockstep.server.recording.reading.reader import Record, RecordingReader
from lockstep.server.recording.reading.scan import Scan, scan_file
from lockstep.server.recording.recording_store import is_written
from lockstep.server.recording.verify.promises import Verdict, Verifier
from lockstep.server.recording.verify.verify_indexes import IndexChecker
from lockstep.server.recording.verify.verify_signature import SignatureChecker

__all__ = ["verify_file"]

_footer = struct.Struct("<QQL")  # start of the summary, start of its offsets, checksum (MCAP specification, "Footer")


def verify_file(path: Path, key: str = "") -> Verdict:
    """Check a recording against Lockstep's promises.

    Args:
        key: public key that has to have signed it; "": any, or none

    Raises:
        RecordingDamaged: it is no recording at all.
        OSError: it cannot be read.
    """
    written = _is_written(path)
    verdict, ended = _verify(path, key, written=written)
    if written and ended:  # it has ended meanwhile, and is whole by now
        verdict, _ = _verify(path, key, written=_is_written(path))
    return verdict


def _verify(path: Path, key: str, *, written: bool) -> tuple[Verdict, bool]:
    """Return the verdict, and whether a file without an index was found to have an end."""
    with RecordingReader(path) as reader:
        verifier = Verifier(reader.info.epoch)
        if reader.interrupted:
            what = "is still written" if written else "was interrupted"
            verifier.fail("readable", f"the recording {what} and has no end" + (" yet" if written else ""))
        elif not _is_summary_whole(path):
            verifier.fail("readable", "the summary does not match its checksum")
        scan = scan_file(path, reader.info)
        # Behind a record that is broken only the file's own index leads to chunks.
        with RecordingReader(path, scan.index if scan.ended else reader.index) as judged:
            ended = _show_records(verifier, judged, reader.index)
        _show_signatures(verifier, path, reader, scan, key, written=written)
        return verifier.verdict(ended), scan.ended and reader.interrupted


def _is_written(path: Path) -> bool:
    try:
        return is_written(path)
    except OSError:  # a file system without locks; whether it can be read shows itself
        return False


def _show_records(verifier: Verifier, reader: RecordingReader, index: EventIndex) -> int:
    """Show all records, compare their number with the file's own index, and return the arrival of the last one, µs."""
    robots: set[str] = set()
    counts: dict[str, int] = {}
    ended = index.started
    for number in range(len(reader.index.chunks)):
        try:
            for record in reader.chunk(number):
                ended = max(ended, record.arrived // 1000)
                counts[record.topic] = counts.get(record.topic, 0) + 1
                _show(verifier, record, robots)
        except RecordingError as error:
            verifier.fail("readable", error.detail)
    for topic in sorted({*index.counts, *counts}):
        said, found = index.counts.get(topic, 0), counts.get(topic, 0)
        if said != found:
            verifier.fail("complete", f"{topic}: the index counts {said} records, but the file has {found}")
    return ended


def _is_summary_whole(path: Path) -> bool:
    """Return whether the summary matches the checksum in the footer. Other programs read it; no signature covers it."""
    with open_regular(path) as file:
        at = file.seek(0, os.SEEK_END) - len(MAGIC) - _footer.size
        file.seek(at)
        start, _, checksum = _footer.unpack(file.read(_footer.size))
        if not 0 <= at - start <= MAX_RECORD:
            return False
        file.seek(start)
        return zlib.crc32(file.read(at + _footer.size - 4 - start)) == int(checksum)


def _show_signatures(
    verifier: Verifier, path: Path, reader: RecordingReader, scan: Scan, key: str, *, written: bool
) -> None:
    """Check indexes and signatures, and show `verifier` the report."""
    checker = SignatureChecker(reader.info, IndexChecker(None if reader.interrupted else reader.index), key)
    with open_regular(path) as file:
        file.seek(len(MAGIC))
        try:
            for raw in raw_records(file):
                checker.take(raw)
        except RecordingError as error:
            verifier.fail("readable", error.detail)
    checker.compare(scan)
    report = checker.report(written=written)
    verifier.signed(report)
    if report.state == "unsigned":
        for text in checker.index_faults:
            verifier.fail("readable", text)
    if not (scan.ended or reader.interrupted):
        verifier.fail("readable", f"the record at byte {scan.whole} cannot be read")


def _show(verifier: Verifier, record: Record, robots: set[str]) -> None:
    stream = stream_of(record.topic)
    if stream:
        if stream in robots:  # the console's own streams go by another clock
            verifier.medium(stream, record.event, record.arrived, record.captured)
        return
    own = own_record_of(record.schema, record.data)
    if own is None:
        return
    if own.event != record.event:
        text = f"{record.topic}: the record says event {own.event}, but its event reference says {record.event}"
        verifier.fail("monotonic", text, record.event, record.arrived // 1000)
    if isinstance(own, RobotRecord):
        robots.update(camera.name for camera in own.description.cameras)
        robots.update(microphone.name for microphone in own.description.microphones)
    verifier.record(own, record.arrived, record.captured)
