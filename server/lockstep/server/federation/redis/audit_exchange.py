"""Shares the audit through the board: sends this console's records, and reads everybody's."""

from collections import deque

from lockstep.server.audit.records import AuditRecord
from lockstep.server.federation.board import SharedAudit, SharedRecord
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import BoardError, BoardInput, BoardSilent, BoardUnreachable
from lockstep.server.federation.messages import MAX_AUDIT_LINE, pack_record, unpack_record
from lockstep.server.federation.metrics import BoardMetrics
from lockstep.server.federation.redis.board_health import BoardHealth
from lockstep.server.federation.redis.redis_store import RedisStore

__all__ = ["AuditExchange"]

MAX_WAITING = 2048  # audit records that could not be shared yet; then the oldest are dropped
BATCH = 256


class AuditExchange:
    """The records that wait to be shared. `console`: the name of this one."""

    def __init__(self, console: str, seal: Seal, health: BoardHealth, metrics: BoardMetrics) -> None:
        self._console = console
        self._seal = seal
        self._health = health
        self._metrics = metrics
        self._waiting: deque[tuple[str, AuditRecord]] = deque()
        self._unshared = ""  # reason that the audit log cannot be shared

    def record(self, robot: str, record: AuditRecord) -> None:
        if len(self._waiting) >= MAX_WAITING:
            self._waiting.popleft()
            self._metrics.lost.labels("audit").inc()
        self._waiting.append((robot, record))

    async def share(self, store: RedisStore) -> None:
        """Send all that waits.

        Raises:
            BoardSilent, BoardUnreachable: no answer in time, or no connection; other errors are counted.
        """
        while self._waiting:
            batch = [self._waiting[place] for place in range(min(BATCH, len(self._waiting)))]
            packed = [pack_record(self._seal, self._console, robot, record) for robot, record in batch]
            fitting = [each for each in packed if sum(map(len, each.values())) <= MAX_AUDIT_LINE]
            self._metrics.lost.labels("audit").inc(len(packed) - len(fitting))
            try:
                await store.append(fitting)
            except (BoardSilent, BoardUnreachable):
                raise
            except BoardError as error:
                self._unshared = self._health.once(self._unshared, error, "the audit log cannot be shared")
                return
            self._unshared = ""
            for each in batch:
                if self._waiting and self._waiting[0] is each:  # else it was dropped for a newer one meanwhile
                    self._waiting.popleft()

    async def newest(self, store: RedisStore, limit: int) -> SharedAudit:
        """Return the newest `limit` records that consoles have shared."""
        try:
            entries = await store.newest(limit)
        except BoardError as error:
            self._health.count(error)
            return SharedAudit([], False, str(error))
        found: dict[
            tuple[str, str, int], SharedRecord
        ] = {}  # a record that was shared twice, after trouble, counts once
        for fields in reversed(entries):
            try:
                each = unpack_record(self._seal, fields)
            except BoardInput as error:
                self._health.count(error)
                continue
            found[each.console, each.robot, each.record.n] = each
        records = sorted(found.values(), key=lambda each: each.record.time)
        return SharedAudit(records, not self._unshared, self._unshared)
