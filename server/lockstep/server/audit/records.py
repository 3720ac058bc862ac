"""The audit's records of who drove when, and of other events worth knowing afterwards. No I/O, no clock."""

from collections.abc import Iterator
from typing import Literal, NamedTuple

import msgspec

from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["CHATTER", "Actor", "AuditBudget", "AuditKind", "AuditMerger", "AuditRecord", "AuditTrouble"]

AuditKind = Literal[
    "start",  # the console, not the robot
    "joined",
    "renamed",
    "left",
    "seat",  # another holder, or none
    "claim",  # the claims on the seat changed
    "stop",
    "reset",
    "action",  # asked for, refused by the console, cancelled, ended
    "silence",  # of a link's stops by a supervisor: begun, ended
    "refusal",  # merged: `count` of the same within a second
    "invitation",
    "revocation",
    "note",
    "link_up",
    "link_down",
    "epoch",
    "recording",  # started, ended, downloaded, deleted
    "reading",  # of a recording; merged
    "pairing",  # of a robot that dials in: a code, its use, a refusal, the end
    "publication",  # of a camera by WHIP: begun, ended
    "audit",  # records were lost before this one
]

# Kinds that one link can cause as often as it likes. They are kept in a separate file, which is full sooner.
CHATTER: frozenset[AuditKind] = frozenset({"joined", "renamed", "left", "claim", "refusal", "note", "reading"})

# Kinds that are written one by one only as often as their link's budget allows; the rest is counted together.
# The others are either not caused by a link, or limited where they are asked for.
LIMITED: frozenset[AuditKind] = frozenset(
    {
        "action",
        "joined",
        "renamed",
        "left",
        "seat",
        "claim",
        "invitation",
        "revocation",
        "recording",
        "reading",
        "publication",
        "pairing",
    }
)
BURST = 30.0  # records of one kind and link at once
RATE = 0.1  # Hz, afterwards
MAX_BUDGETS = 1024  # pairs of kind and link; further links of a kind share one

MAX_PENDING = 256  # different keys within one interval; further ones are counted together


class Actor(NamedTuple):
    """The person behind a record, with connection and link."""

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


class AuditTrouble(msgspec.Struct, frozen=True):
    """An event of the session: the log cannot be written now, or it can be again."""

    trouble: str  # the reason; "": it can be written again
    lost: int  # records lost for good since the start


class AuditBudget:
    """Limits how often a link may have a kind of record written one by one. `now` is monotonic seconds."""

    def __init__(self) -> None:
        self._buckets: dict[tuple[AuditKind, str], TokenBucket] = {}

    def take(self, kind: AuditKind, link: str, now: float) -> bool:
        """Take one record from the budget; False if it is used up."""
        key = (kind, link)
        if key not in self._buckets and len(self._buckets) >= MAX_BUDGETS:
            key = (kind, "")
        if key not in self._buckets:
            self._buckets[key] = TokenBucket(RATE, BURST)
        return self._buckets[key].take(now)

    def forget_idle(self, now: float) -> None:
        """Drop the budgets that are full again."""
        self._buckets = {key: bucket for key, bucket in self._buckets.items() if not bucket.is_full(now)}


class AuditMerger:
    """Counts repeated actions of the same peer; a flood of them becomes one record an interval."""

    def __init__(self) -> None:
        self._counts: dict[tuple[AuditKind, Actor, str], int] = {}

    def add(self, kind: AuditKind, actor: Actor, what: str, count: int = 1) -> None:
        key = (kind, actor, what)
        if key not in self._counts and len(self._counts) >= MAX_PENDING:
            key = (kind, Actor(), "others")
        self._counts[key] = self._counts.get(key, 0) + count

    def take(self) -> Iterator[tuple[AuditKind, Actor, str, int]]:
        """Yield what was added since the last call: kind, actor, what, and how often."""
        counts, self._counts = self._counts, {}
        for (kind, actor, what), count in counts.items():
            yield kind, actor, what, count
