"""The last records of the audit, in memory: what supervisors are shown. No I/O."""

from collections import deque
from collections.abc import Iterable, Iterator

from server.audit import AuditRecord

__all__ = ["AuditTail"]

KEPT = 5000  # records; about 2 MB


class AuditTail:
    def __init__(self, records: Iterable[AuditRecord] = ()) -> None:
        self._records: deque[AuditRecord] = deque(records, maxlen=KEPT)

    def __iter__(self) -> Iterator[AuditRecord]:
        return iter(list(self._records))

    @property
    def next_number(self) -> int:
        return self._records[-1].n + 1 if self._records else 1

    def append(self, record: AuditRecord) -> None:
        self._records.append(record)

    def after(self, n: int, limit: int) -> list[AuditRecord]:
        """The first `limit` records behind number `n` of those that are kept; with a negative `n` the newest."""
        if n < 0:
            return list(self._records)[-limit:]
        return [record for record in self._records if record.n > n][:limit]
