"""The audit's records: who drove when, and what else somebody may want to know afterwards. No I/O, no clock."""

from collections.abc import Iterator
from typing import Literal, NamedTuple

import msgspec

__all__ = ["Actor", "AuditKind", "AuditMerger", "AuditRecord"]

AuditKind = Literal[
    "start",  # the console, not the robot
    "joined",
    "renamed",
    "left",
    "seat",  # another holder, or none
    "claim",  # the claims on the seat changed
    "stop",
    "reset",
    "refusal",  # merged: `count` of the same within a second
    "invitation",
    "revocation",
    "note",
    "link_up",
    "link_down",
    "epoch",
    "audit",  # records were lost before this one
]

MAX_PENDING = 256  # different keys within one interval; further ones are counted together


class Actor(NamedTuple):
    """Who did something."""

    name: str = ""
    role: str = ""
    peer: str = ""  # the connection; "" over HTTP
    link: str = ""  # id of the link that was used; never the token


class AuditRecord(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One line of the audit log. What is empty is left out."""

    n: int  # counts up without gaps, over restarts too; a gap means lost records
    time: float  # s since 1970, the console's clock: for people to read, never for a decision
    kind: AuditKind
    epoch: str = ""
    event: int = 0  # reference at that moment; 0 before the robot was reached
    who: str = ""
    role: str = ""
    peer: str = ""
    link: str = ""
    what: str = ""  # "granted", the refusal's reason, the channel of a stop
    detail: str = ""
    count: int = 1


class AuditMerger:
    """Counts what the same peer did again; a flood of it becomes one record a second."""

    def __init__(self) -> None:
        self._counts: dict[tuple[AuditKind, Actor, str], int] = {}

    def add(self, kind: AuditKind, actor: Actor, what: str) -> None:
        key = (kind, actor, what)
        if key not in self._counts and len(self._counts) >= MAX_PENDING:
            key = (kind, Actor(), "others")
        self._counts[key] = self._counts.get(key, 0) + 1

    def take(self) -> Iterator[tuple[AuditKind, Actor, str, int]]:
        """What came since the last time: who, what, how often."""
        counts, self._counts = self._counts, {}
        for (kind, actor, what), count in counts.items():
            yield kind, actor, what, count
