"""What the routes of recordings need."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from server.access import Access
from server.audit import Actor, AuditKind
from server.recording.library import Library

__all__ = ["RecordingAudit", "RecordingService"]


class RecordingAudit(Protocol):
    """What the routes need of the audit."""

    def record(self, kind: AuditKind, actor: Actor = ..., what: str = ..., detail: str = ...) -> None: ...
    def again(self, kind: AuditKind, actor: Actor, what: str) -> None: ...


class _NoAudit:
    def record(self, kind: AuditKind, actor: Actor = Actor(), what: str = "", detail: str = "") -> None:  # noqa: B008
        pass

    def again(self, kind: AuditKind, actor: Actor, what: str) -> None:
        pass


@dataclass(frozen=True)
class RecordingService:
    """`app.state.recordings`; None while a robot's session has failed.

    Attributes:
        holds_seat: whether a peer with the link of this id drives
        opens_all: every good link reads everything: it was made for the one file that is replayed
    """

    library: Library
    access: Access
    audit: RecordingAudit = _NoAudit()
    holds_seat: Callable[[str], bool] = lambda link: False
    opens_all: bool = False
