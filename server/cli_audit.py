"""`lockstep audit --verify`: what the chain and the signed heads say of an audit, in words."""

import sys
from pathlib import Path
from typing import NamedTuple

import msgspec

from server.audit_file import chained_lines, chatter_path
from server.audit_store import audit_name
from server.evidence.anchors import Anchor, AnchorFile, AnchorNote, check_anchors
from server.evidence.chain import ChainReport, check_chain

__all__ = ["AuditVerdict", "verify_audit"]


class AuditVerdict(NamedTuple):
    own: ChainReport
    chatter: ChainReport
    anchors: AnchorNote
    key: str  # that the heads had to be signed with; "" where none is known

    @property
    def ok(self) -> bool:
        return not self.own.count and not self.chatter.count

    def say(self, path: Path) -> None:
        """Print it."""
        for name, report in ((path.name, self.own), (chatter_path(path).name, self.chatter)):
            sys.stdout.write("\n".join(_chain_words(name, report)) + "\n")
        sys.stdout.write("\n".join(_anchor_words(self.anchors, self.own, self.key)) + "\n")

    def as_json(self) -> bytes:
        shown = [msgspec.structs.replace(each, hashes={}) for each in (self.own, self.chatter)]
        found = {"ok": self.ok, "audit": shown[0], "chatter": shown[1], "anchors": self.anchors, "key": self.key}
        return msgspec.json.encode(found)


def verify_audit(path: Path, robot: str, anchors: Path, key: str) -> AuditVerdict:
    """Of the audit at `path`.

    Args:
        anchors: file or folder of its signed heads; one that is not there holds none
        key: public key that signs them; "": that of the newest one

    Raises:
        OSError: something cannot be read.
    """
    own, chatter = check_chain(chained_lines(path)), check_chain(chained_lines(chatter_path(path)))
    signed = AnchorFile(anchors, 0).read(audit_name(path, robot))
    key = key or _key_of(signed)
    return AuditVerdict(own, chatter, check_anchors(own, chatter, signed, key), key)


def _key_of(anchors: list[Anchor]) -> str:
    return anchors[-1].key if anchors else ""


def _chain_words(name: str, report: ChainReport) -> list[str]:
    if not report.records:
        return [f"ok    {name}: no records"] if not report.count else [f"FAIL  {name}: no records", *_faults(report)]
    numbers = f"{report.records} records, {report.first} to {report.last}"
    lines = [f"{'FAIL' if report.count else 'ok  '}  {name}: {numbers}, head {report.head}"]
    if report.earlier:
        lines.append(f"        what came before record {report.first} is not kept any more")
    if report.unchained:
        lines.append(f"        the first {report.unchained} are of a version without a chain")
    lines += [f"        {place} is no record: a write that was cut off" for place in report.unreadable[:5]]
    return lines + _faults(report)


def _faults(report: ChainReport) -> list[str]:
    return [f"        {fault.kind}: {fault.text}" for fault in report.faults[:20]]


def _anchor_words(note: AnchorNote, own: ChainReport, key: str) -> list[str]:
    if note.newest is None:
        return [
            f"--    {note.known} signed heads, none of this audit and key: whoever could write the files is not found"
        ]
    newest = note.newest
    lines = [
        f"ok    {note.fitting + note.too_old} signed heads fit ({note.too_old} of records that are not kept any more)",
        f"        signed by {key}",
        f"        the newest is of record {newest.n}: what came later could be cut off unseen",
    ]
    if note.other_keys:
        lines.append(f"        {note.other_keys} are signed by other keys, and say nothing here")
    return lines
