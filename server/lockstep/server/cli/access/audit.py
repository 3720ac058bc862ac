"""`lockstep audit --verify`: checks the chain and the signed heads of an audit, and reports in words."""

import sys
from pathlib import Path
from typing import NamedTuple

import msgspec

from lockstep.server.audit.audit_file import chained_lines, chatter_path
from lockstep.server.audit.audit_store import audit_name
from lockstep.server.evidence.anchors import Anchor, AnchorFile, AnchorNote, check_anchors, parse_anchor
from lockstep.server.evidence.chain import ChainReport, check_chain
from lockstep.server.recording.format.payload import own_record
from lockstep.server.recording.format.records import SignatureRecord
from lockstep.server.recording.format.topics import SIGNATURE
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.util.display_names import escaped

__all__ = ["AuditVerdict", "verify_audit"]


class AuditVerdict(NamedTuple):
    own: ChainReport
    chatter: ChainReport
    anchors: AnchorNote
    place: Path  # file or folder of the signed heads, or a recording
    key: str  # key that the heads had to be signed with; "" where none is known

    @property
    def ok(self) -> bool:
        return not self.own.count and not self.chatter.count

    def say(self, path: Path) -> None:
        """Print the verdict."""
        for name, report in ((path.name, self.own), (chatter_path(path).name, self.chatter)):
            sys.stdout.write("\n".join(map(escaped, _chain_words(name, report))) + "\n")
        sys.stdout.write("\n".join(map(escaped, _anchor_words(self))) + "\n")

    def as_json(self) -> bytes:
        shown = [msgspec.structs.replace(each, hashes={}) for each in (self.own, self.chatter)]
        found = {"ok": self.ok, "audit": shown[0], "chatter": shown[1], "anchors": self.anchors, "key": self.key}
        return msgspec.json.encode(found)


def verify_audit(path: Path, robot: str, anchors: Path, key: str) -> AuditVerdict:
    """Check the audit at `path`.

    Args:
        anchors: file or folder of its signed heads, or a recording; one that is not there holds none
        key: public key that signs them; "": that of the newest one

    Raises:
        OSError: something cannot be read.
        RecordingError: the recording is not readable.
    """
    own, chatter = check_chain(chained_lines(path)), check_chain(chained_lines(chatter_path(path)))
    name = audit_name(path, robot)
    signed = _recorded(anchors, name) if anchors.suffix == ".mcap" else AnchorFile(anchors, 0).read(name)
    key = key or _key_of(signed)
    return AuditVerdict(own, chatter, check_anchors(own, chatter, signed, key), anchors, key)


def _recorded(recording: Path, name: str) -> list[Anchor]:
    """Return the signed heads that the signatures of a recording hold."""
    found: dict[str, Anchor] = {}
    with RecordingReader(recording) as reader:
        for record in reader.records(topics={SIGNATURE}):
            anchor = parse_anchor(own_record(SignatureRecord, record.data).audit)
            if anchor is not None and anchor.log == name:
                found[anchor.signature] = anchor
    return list(found.values())


def _key_of(anchors: list[Anchor]) -> str:
    return anchors[-1].key if anchors else ""


def _chain_words(name: str, report: ChainReport) -> list[str]:
    if not report.records:
        return [f"ok    {name}: no records"] if not report.count else [f"FAIL  {name}: no records", *_faults(report)]
    numbers = f"{report.records} records, {report.first} to {report.last}"
    lines = [f"{'FAIL' if report.count else 'ok  '}  {name}: {numbers}, head {report.head}"]
    if report.earlier:
        lines.append(f"        the records before {report.first} are no longer kept")
    if report.unchained:
        lines.append(f"        the first {report.unchained} records come from a version without a hash chain")
    lines += [f"        {place} is not a record: a write was cut off" for place in report.unreadable[:5]]
    return lines + _faults(report)


def _faults(report: ChainReport) -> list[str]:
    return [f"        {fault.kind}: {fault.text}" for fault in report.faults[:20]]


def _anchor_words(verdict: AuditVerdict) -> list[str]:
    note, key = verdict.anchors, verdict.key
    if note.newest is None:
        return [
            f"--    {note.known} signed heads in {verdict.place}, but none fits this audit log and key:",
            "        this check would not find a cut at the end, or files that were written again",
        ]
    lines = [
        f"ok    {note.fitting + note.too_old} signed heads fit ({note.too_old} of records that are no longer kept)",
        f"        signed by {key}",
        f"        the newest is of record {note.newest.n}: this check would not find a cut after that record",
    ]
    if note.other_keys:
        lines.append(f"        {note.other_keys} signed heads have other keys and were not used")
    return lines
