"""Signed heads of the audit, against which anybody with the public key can check the files later.

Nothing but `AnchorFile` does I/O; nothing reads a clock.
"""

import errno
import os
from collections.abc import Iterable
from pathlib import Path

import msgspec

from lockstep.protocol.files.regular_file import bounded_lines, open_regular
from lockstep.server.evidence.chain import ChainReport
from lockstep.server.evidence.signer import Signer, is_signed

__all__ = [
    "ANCHORS_NAME",
    "Anchor",
    "AnchorFile",
    "AnchorNote",
    "anchor_text",
    "check_anchors",
    "parse_anchor",
    "sign_anchor",
]

ANCHORS_NAME = "audit-anchors.jsonl"
DOMAIN = b"lockstep audit anchor 1\n"  # nothing else that this key signs begins with it


class Anchor(msgspec.Struct, frozen=True, kw_only=True):
    """States that the audit ended with these two records at that time.

    The signature covers `DOMAIN` and this struct with an empty signature.
    """

    version: int = 1
    log: str  # name of the audit: "audit", in a fleet "left/audit"; several may share one file of anchors
    n: int  # of the last record in the audit's file; 0 without records
    head: str  # its hash
    chatter_n: int  # the same for the chatter file
    chatter_head: str
    time: float  # s since 1970, the console's clock
    key: str
    signature: str = ""

    @property
    def is_valid(self) -> bool:
        return is_signed(self.key, _signed_bytes(self), self.signature)


_decoder = msgspec.json.Decoder(Anchor)


def _signed_bytes(anchor: Anchor) -> bytes:
    return DOMAIN + msgspec.json.encode(msgspec.structs.replace(anchor, signature=""))


def sign_anchor(anchor: Anchor, signer: Signer) -> Anchor:
    return msgspec.structs.replace(anchor, signature=signer.sign(_signed_bytes(anchor)))


def parse_anchor(line: bytes | str) -> Anchor | None:
    """Parse a line; None if it is not an anchor, or its signature does not fit."""
    try:
        found = _decoder.decode(line)
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None
    return found if found.is_valid else None


def anchor_text(anchor: Anchor | None) -> str:
    """Return the text that `parse_anchor` takes; "" for None."""
    return "" if anchor is None else msgspec.json.encode(anchor).decode()


class AnchorNote(msgspec.Struct, kw_only=True):
    """The result of checking an audit against its anchors."""

    known: int = 0  # anchors that were checked
    fitting: int = 0
    other_keys: int = 0
    too_old: int = 0  # anchors of records that are not kept any more
    newest: Anchor | None = None  # of those that fit


def check_anchors(audit: ChainReport, chatter: ChainReport, anchors: Iterable[Anchor], key: str) -> AnchorNote:
    """Check the audit's two files against the anchors signed with `key`; add faults to the reports."""
    note = AnchorNote()
    for anchor in anchors:
        note.known += 1
        if anchor.key != key:
            note.other_keys += 1
            continue
        fits = _fits(audit, anchor.n, anchor.head), _fits(chatter, anchor.chatter_n, anchor.chatter_head)
        if False in fits:
            continue
        if None in fits:
            note.too_old += 1
        else:
            note.fitting += 1
        if note.newest is None or anchor.time >= note.newest.time:
            note.newest = anchor
    return note


def _fits(report: ChainReport, n: int, head: str) -> bool | None:
    """True if record `n` has the hash `head`, False after a fault; None if it is not kept any more."""
    if n == 0:
        return True
    known = report.hashes.get(n)
    if known == head:
        return True
    if known is not None:
        report.fault("anchor", n, f"record {n} is not as it was signed: that record, or one before it, was changed")
        return False
    if n > report.last:
        report.fault("cut", n, f"the end was cut off after record {report.last}: record {n} was signed")
        return False
    if n < report.first:
        return None
    report.fault("cut", n, f"record {n} was signed but is missing")
    return False


class AnchorFile:
    """A file of anchors, only ever appended to. Blocks; used from one thread.

    Args:
        max_bytes: size at which the file is rotated; one older file is kept
    """

    def __init__(self, path: Path, max_bytes: int) -> None:
        self.path = path / ANCHORS_NAME if path.is_dir() or not path.suffix else path
        self._max_bytes = max_bytes

    def append(self, anchor: Anchor) -> None:
        """Append an anchor. Raises OSError: it was not written, or not as a whole."""
        self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if self.path.exists() and self.path.stat().st_size > self._max_bytes:
            os.replace(self.path, self._older)
        handle = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            line = msgspec.json.encode(anchor) + b"\n"
            size = os.fstat(handle).st_size
            if size and os.pread(handle, 1, size - 1) != b"\n":  # a full disk cut the last one off
                line = b"\n" + line
            if os.write(handle, line) < len(line):  # one write: others may append too
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(handle)
        finally:
            os.close(handle)

    def read(self, log: str) -> list[Anchor]:
        """Return the anchors of that audit whose signatures fit, oldest first. Raises OSError."""
        found: list[Anchor] = []
        for path in (self._older, self.path):
            if path.exists():
                with open_regular(path) as file:
                    anchors = map(parse_anchor, bounded_lines(file))
                    found += [anchor for anchor in anchors if anchor is not None and anchor.log == log]
        return found

    @property
    def _older(self) -> Path:
        return self.path.with_name(f"{self.path.name}.1")
