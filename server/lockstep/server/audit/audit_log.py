"""The audit log of one console: its file, its thread, its last records in memory, and any reason why it fails."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec
import structlog

from lockstep.server.audit.audit_file import last_records
from lockstep.server.audit.audit_store import AuditStore
from lockstep.server.audit.audit_tail import AuditTail
from lockstep.server.audit.audit_writer import AuditWriter, RecordFile
from lockstep.server.audit.records import AuditRecord, AuditTrouble
from lockstep.server.evidence.anchors import ANCHORS_NAME, Anchor, AnchorFile
from lockstep.server.evidence.signer import Signer
from lockstep.server.recording.settings import recordings_directory
from lockstep.server.settings import Settings
from lockstep.server.util.state_dir import StateDir, StateDirUnusable

__all__ = ["AuditLog", "anchors_path", "open_audit_log"]

log = structlog.get_logger(__name__)

Publish = Callable[[AuditRecord | AuditTrouble], None]


def _ignore(event: AuditRecord | AuditTrouble) -> None:
    pass


class AuditLog:
    """Keeps records in memory and on disk. Call `append` from the loop.

    Attributes:
        tail: the last records, those of earlier runs included
        trouble: the reason if it cannot be written at present, else ""
        newest_anchor: returns the newest signed head, None before the first; thread-safe
    """

    def __init__(
        self,
        file: RecordFile,
        earlier: list[AuditRecord],
        newest_anchor: Callable[[], Anchor | None] = lambda: None,
        publish: Publish = _ignore,
    ) -> None:
        """`publish`: called on the loop with every record, and whenever `trouble` changes."""
        self.tail = AuditTail(earlier)
        self.trouble = ""
        self.newest_anchor = newest_anchor
        self._publish = publish
        self._loop = asyncio.get_running_loop()
        self._writer = AuditWriter(file, self._changed)
        self._writer.start()

    @property
    def lost(self) -> int:
        return self._writer.lost

    @property
    def failures(self) -> int:
        return self._writer.failures

    @property
    def next_number(self) -> int:
        return self.tail.next_number

    def __iter__(self) -> Iterator[AuditRecord]:
        return iter(self.tail)

    def append(self, record: AuditRecord) -> None:
        self.tail.append(record)
        self._writer.append(record)
        self._publish(record)

    def close(self) -> None:
        self._publish = _ignore
        self._writer.close()

    def _changed(self, trouble: str) -> None:
        """Pass `trouble` to the loop; called in the writer's thread."""
        try:
            self._loop.call_soon_threadsafe(self._tell, trouble)
        except RuntimeError:
            return  # the loop is closed: there is nobody left to tell

    def _tell(self, trouble: str) -> None:
        self.trouble = trouble
        if trouble:
            log.error("the audit log cannot be written", error="audit_unwritable", detail=trouble)
        else:
            log.info("the audit log is written again", lost=self.lost)
        self._publish(AuditTrouble(trouble, self.lost))


@contextmanager
def open_audit_log(
    directory: StateDir,
    settings: Settings,
    robot: str = "",
    signer: Signer | None = None,
    publish: Publish = _ignore,
) -> Iterator[AuditLog]:
    """Open the audit log, which continues the numbers of the last run.

    If its file cannot be opened, records stay in memory until it can; `trouble` says why.

    Args:
        signer: signs its heads; None: they are not signed
        publish: called on the loop with every record, and when the log cannot be written or can be again
    """

    def store_at(path: Path) -> AuditStore:
        anchors = AnchorFile(anchors_path(settings, directory.path), settings.audit_bytes)
        return AuditStore(path, settings.audit_bytes, settings.audit_files, robot, signer, anchors)

    with ExitStack() as opened:
        try:
            path = opened.enter_context(directory.own_log("audit"))
        except StateDirUnusable:
            late = _LateFile(directory, store_at)
            found = AuditLog(late, [], lambda: late.newest_anchor, publish)
        else:
            store = store_at(path)
            found = AuditLog(store, last_records(path), lambda: store.newest_anchor, publish)
        opened.callback(found.close)
        yield found


def anchors_path(settings: Settings, directory: Path) -> Path:
    """Return the path for signed heads of the audit in that directory: as set, or else beside the recordings."""
    return settings.audit_anchor or recordings_directory(settings.recording, directory) / ANCHORS_NAME


class _LateFile:
    """Stands in for a file that could not be opened at the start: each attempt to write tries again.

    Blocks: used from the writer's thread only. Records that were numbered without knowing those on the disk are
    renumbered to come after them.
    """

    def __init__(self, directory: StateDir, store_at: Callable[[Path], AuditStore]) -> None:
        self._directory = directory
        self._store_at = store_at
        self._store: AuditStore | None = None
        self._ahead = 0  # numbers on the disk before this run's first
        self._held = ExitStack()  # the lock of the file

    @property
    def newest_anchor(self) -> Anchor | None:
        return None if self._store is None else self._store.newest_anchor

    def write(self, records: list[AuditRecord]) -> None:
        store = self._opened(records[0].n)
        store.write([msgspec.structs.replace(record, n=record.n + self._ahead) for record in records])

    def _opened(self, first: int) -> AuditStore:
        if self._store is None:
            with ExitStack() as opened:
                try:
                    store = self._store_at(opened.enter_context(self._directory.own_log("audit")))
                except StateDirUnusable as error:
                    raise OSError(error.reason) from error
                self._ahead = max(0, store.last() - first + 1)
                self._held = opened.pop_all()
            self._store = store
        return self._store

    def settle(self) -> None:
        if self._store is not None:
            self._store.settle()

    def close(self) -> None:
        with self._held:
            if self._store is not None:
                self._store.close()
