"""Stores the audit's records in one file, chatter in another, and signed heads of both elsewhere."""

import time
from pathlib import Path

import structlog

from lockstep.server.audit.audit_file import AuditFile, chatter_path
from lockstep.server.audit.records import CHATTER, AuditRecord
from lockstep.server.evidence.anchors import Anchor, AnchorFile, sign_anchor
from lockstep.server.evidence.signer import Signer

__all__ = ["AuditStore", "audit_name"]

log = structlog.get_logger(__name__)

ANCHOR_SECONDS = 60.0  # between two signed heads, while anything is written


def audit_name(path: Path, robot: str) -> str:
    """Return the name of the audit at `path` in anchors."""
    return f"{robot}/{path.stem}" if robot else path.stem


class AuditStore:
    """The files of one audit. Blocks: used from the writer's thread only.

    Attributes:
        newest_anchor: the signed head that was made last; None before the first
    """

    def __init__(
        self,
        path: Path,
        max_bytes: int,
        files: int,
        robot: str = "",
        signer: Signer | None = None,
        anchors: AnchorFile | None = None,
    ) -> None:
        self.newest_anchor: Anchor | None = None
        self._own = AuditFile(path, max_bytes, files)
        self._chatter = AuditFile(chatter_path(path), max_bytes, files)
        self._name = audit_name(path, robot)
        self._signer = signer
        self._anchors = anchors
        self._anchored_at = -ANCHOR_SECONDS
        self._trouble = False  # the newest anchor could not be written
        self._written = 0  # number up to which the audit's own file has the records of this run

    def write(self, records: list[AuditRecord]) -> None:
        """Write all records safely to disk. After an OSError call again with all: written ones are skipped."""
        own = [record for record in records if record.kind not in CHATTER and record.n > self._written]
        chatter = [record for record in records if record.kind in CHATTER]
        if own:
            self._own.write(own)
            self._written = own[-1].n
        if chatter:
            self._chatter.write(chatter)

    def last(self) -> int:
        """Return the number of the newest record on the disk, 0 without records. Raises OSError."""
        self._own.open()
        self._chatter.open()
        return max(self._own.last, self._chatter.last)

    def settle(self) -> None:
        """Sign the heads if that is due; called when no record waits."""
        if time.monotonic() - self._anchored_at >= ANCHOR_SECONDS:
            self._anchor()

    def close(self) -> None:
        self._anchor()
        self._own.close()
        self._chatter.close()

    def _anchor(self) -> None:
        """Sign the heads of both files. Never raises: the audit itself goes on."""
        if self._signer is None or self._anchors is None:
            return
        try:
            self._own.open()
            self._chatter.open()
            if self._is_anchored() and not self._trouble:
                return
            anchor = sign_anchor(self._head(self._signer), self._signer)
            self.newest_anchor = anchor
            self._anchored_at = time.monotonic()
            self._anchors.append(anchor)
        except OSError as error:
            if not self._trouble:
                path = str(self._anchors.path)
                log.error("signed heads of the audit cannot be written", path=path, detail=error.strerror or str(error))
            self._trouble = True
        else:
            if self._trouble:
                log.info("signed heads of the audit are written again", path=str(self._anchors.path))
            self._trouble = False

    def _is_anchored(self) -> bool:
        newest = self.newest_anchor
        return newest is not None and (newest.head, newest.chatter_head) == (self._own.head, self._chatter.head)

    def _head(self, signer: Signer) -> Anchor:
        return Anchor(
            log=self._name,
            n=self._own.last,
            head=self._own.head,
            chatter_n=self._chatter.last,
            chatter_head=self._chatter.head,
            time=round(time.time(), 3),
            key=signer.public_key,
        )
