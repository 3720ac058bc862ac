"""Keeps the directory of recordings within its bounds of age and size, and says in the audit what was deleted."""

import asyncio
import time

import structlog

from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.recording.episodes.episode_before import EpisodeBefore, episode_before
from lockstep.server.recording.recording_store import RecordingStore

__all__ = ["Retention"]

log = structlog.get_logger(__name__)


class Retention:
    """Run `prepare` once, then `prune` at intervals. A failure is logged, and tried again with the next call."""

    def __init__(self, store: RecordingStore, audit: AuditTrail) -> None:
        self._store = store
        self._audit = audit

    async def prepare(self) -> EpisodeBefore | None:
        """Make the directory, complete interrupted recordings, and make room; return the last episode recorded."""
        deleted, before = await asyncio.to_thread(self._prepare)
        self._tell(deleted)
        return before

    async def prune(self) -> None:
        """Make room."""
        self._tell(await asyncio.to_thread(self._prune))

    def _prepare(self) -> tuple[list[str], EpisodeBefore | None]:
        try:
            self._store.prepare()
            self._store.recover()
            before = episode_before(self._store, time.time())
            return self._store.prune(), before
        except OSError as error:
            log.error("the directory of recordings cannot be used", reason=str(error))
            return [], None

    def _prune(self) -> list[str]:
        try:
            return self._store.prune()
        except OSError as error:
            log.error("the directory of recordings cannot be read", reason=str(error))
            return []

    def _tell(self, deleted: list[str]) -> None:
        for recording in deleted:
            self._audit.record("recording", what="deleted to make room", detail=recording)
