"""The dependencies of the recording routes."""

import asyncio
import contextvars
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, TypeVar

from lockstep.server.audit.records import Actor, AuditKind
from lockstep.server.auth.tokens import Access
from lockstep.server.errors import ShuttingDown
from lockstep.server.recording.browsing.catalog import EpisodeCatalog
from lockstep.server.recording.library import Library
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["RecordingAudit", "RecordingService"]


STARTS, START_RATE = 20, 0.1  # Hz, of one link: the recording store is bounded in bytes, not in files
EDITS, EDIT_RATE = 40, 2.0
LISTS, LIST_RATE = 60, 10.0  # of all episodes: many pages with one link ask every few seconds
PICTURES, PICTURE_RATE = 200, 30.0
REPORTS, REPORT_RATE = 4, 0.05
READERS = 2  # threads; readers of recordings wait for each other

Result = TypeVar("Result")


class RecordingAudit(Protocol):
    """The part of the audit that the routes use."""

    def record(self, kind: AuditKind, actor: Actor = ..., what: str = ..., detail: str = ...) -> None: ...
    def again(self, kind: AuditKind, actor: Actor, what: str) -> None: ...


class _NoAudit:
    def record(self, kind: AuditKind, actor: Actor = Actor(), what: str = "", detail: str = "") -> None:  # noqa: B008
        pass

    def again(self, kind: AuditKind, actor: Actor, what: str) -> None:
        pass


@dataclass(frozen=True)
class RecordingService:
    """The recordings of one robot: `app.state.recordings`, which is None while the robot's session has failed.

    Attributes:
        holds_seat: whether a peer with the link of this id drives
        starts, edits, lists, pictures, reports: how often each link may begin a recording, change an episode, ask for
            the list of episodes, for one picture, or for a report
        is_driven: whether somebody drives the robot now: then reading takes little of the machine
        opens_all: every good link reads everything: it was made for the one file that is replayed
    """

    library: Library
    access: Access
    audit: RecordingAudit = _NoAudit()
    holds_seat: Callable[[str], bool] = lambda link: False
    is_driven: Callable[[], bool] = lambda: False
    opens_all: bool = False
    starts: RateLimits = field(default_factory=lambda: RateLimits(START_RATE, STARTS))
    edits: RateLimits = field(default_factory=lambda: RateLimits(EDIT_RATE, EDITS))
    lists: RateLimits = field(default_factory=lambda: RateLimits(LIST_RATE, LISTS))
    pictures: RateLimits = field(default_factory=lambda: RateLimits(PICTURE_RATE, PICTURES))
    reports: RateLimits = field(default_factory=lambda: RateLimits(REPORT_RATE, REPORTS))
    threads: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(READERS, "recordings"))

    @cached_property
    def catalog(self) -> EpisodeCatalog:
        """The episodes of all recordings."""
        return EpisodeCatalog(self.library, self.in_thread, is_driven=self.is_driven)

    async def in_thread(self, work: Callable[[], Result]) -> Result:
        """Run `work`, which reads files. A slow disk, or many readers, take no thread from anything else.

        Raises:
            ShuttingDown: it is closed.
        """
        loop, context = asyncio.get_running_loop(), contextvars.copy_context()
        try:
            reading = loop.run_in_executor(self.threads, context.run, work)
        except RuntimeError as error:
            raise ShuttingDown("the session of this robot ends") from error
        return await reading

    async def close(self) -> None:
        """Close the threads, and end the processes. Idempotent; waits for no thread."""
        await self.catalog.close()
        self.threads.shutdown(wait=False, cancel_futures=True)
