"""The last records of the audit, in memory, as supervisors are shown them. No I/O."""

from collections import deque
from collections.abc import Iterable, Iterator
from itertools import islice

from lockstep.server.audit.records import AuditKind, AuditRecord

__all__ = ["AuditTail"]

KEPT = 5000  # records; about 2 MB


class AuditTail:
    """The last records. A full tail drops one of the kind with the most: the oldest of the link with most of them.

    So a link that causes many records of a kind pushes out its own, and a kind with few records loses none.
    """

    def __init__(self, records: Iterable[AuditRecord] = ()) -> None:
        self._records: dict[int, AuditRecord] = {}  # by number, which only grows
        self._kinds: dict[AuditKind, dict[str, deque[int]]] = {}  # numbers by kind and link
        self._sizes: dict[AuditKind, int] = {}
        self._last = 0
        for record in records:
            self.append(record)

    def __iter__(self) -> Iterator[AuditRecord]:
        return iter(list(self._records.values()))

    @property
    def next_number(self) -> int:
        return self._last + 1

    def append(self, record: AuditRecord) -> None:
        self._last = max(self._last, record.n)
        self._records[record.n] = record
        self._kinds.setdefault(record.kind, {}).setdefault(record.link, deque()).append(record.n)
        self._sizes[record.kind] = self._sizes.get(record.kind, 0) + 1
        if len(self._records) > KEPT:
            self._give_up_one()

    def _give_up_one(self) -> None:
        kind = max(self._sizes, key=lambda each: self._sizes[each])
        links = self._kinds[kind]
        link = max(links, key=lambda each: len(links[each]))
        self._records.pop(links[link].popleft(), None)
        self._sizes[kind] -= 1
        if not links[link]:
            del links[link]

    def after(self, n: int, limit: int) -> list[AuditRecord]:
        """Return the first `limit` records after number `n` of those that are kept; with a negative `n` the newest."""
        if n < 0:
            return self.before(self._last + 1, limit)
        return list(islice((record for record in self._records.values() if record.n > n), limit))

    def before(self, n: int, limit: int) -> list[AuditRecord]:
        """Return the last `limit` records before number `n` of those that are kept, oldest first."""
        found = list(islice((each for each in reversed(self._records.values()) if each.n < n), limit))
        return found[::-1]
