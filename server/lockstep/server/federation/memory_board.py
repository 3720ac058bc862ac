"""The board of a console that is alone."""

import asyncio
from collections.abc import Collection, Sequence

from lockstep.server.audit.records import AuditRecord
from lockstep.server.federation.board import BoardState, SharedAudit, StopAnswer
from lockstep.server.federation.robot_summary import Tile
from lockstep.server.stop.stop_presses import Press

__all__ = ["MemoryBoard"]

ALONE = StopAnswer(confirmed=False, delivered=False, event=0, detail="there is no other console")


class MemoryBoard:
    """A board without other consoles: it sends nothing and receives nothing."""

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
