"""The board of a console that is alone."""

import asyncio
from collections.abc import Collection, Sequence

from server.audit import AuditRecord
from server.board.board import BoardState, SharedAudit, StopAnswer
from server.board.tile import Tile
from server.stop_presses import Press

__all__ = ["MemoryBoard"]

ALONE = StopAnswer(confirmed=False, delivered=False, event=0, detail="there is no other console")


class MemoryBoard:
    """There are no others: nothing is told, nothing is heard."""

    @property
    def state(self) -> BoardState:
        return BoardState()

    async def run(self) -> None:
        await asyncio.Event().wait()

    def publish(self, tiles: Sequence[Tile]) -> None:
        pass

    def others(self) -> list[Tile]:
        return []

    def record(self, robot: str, record: AuditRecord) -> None:
        pass

    async def audit(self, limit: int) -> SharedAudit:
        return SharedAudit([], True, "")

    async def stop(self, robots: Collection[str], press: Press) -> dict[str, StopAnswer]:
        return dict.fromkeys(robots, ALONE)
