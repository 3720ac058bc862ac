"""Boards with a host that only remembers what it was asked for."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager

from prometheus_client import CollectorRegistry

from lockstep.server.auth.invitations import Invitation
from lockstep.server.federation.board import StopAnswer
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.metrics import BoardMetrics
from lockstep.server.federation.redis.redis_board import RedisBoard
from lockstep.server.federation.robot_summary import Tile
from lockstep.server.stop.stop_presses import Press

__all__ = ["KEY", "FakeHost", "FakeLinks", "TestBoard", "running_board", "tile"]

KEY = "k" * 32


def tile(name: str = "left", **more: object) -> Tile:
    return Tile(**{"name": name, "label": "Planar", "url": f"robots/{name}/", "link": "up", **more})  # type: ignore[arg-type]


class FakeHost:
    """Has robots that can always be told, except those in `away`."""

    def __init__(self) -> None:
        self.stops: list[tuple[str, str, str]] = []
        self.presses: list[str] = []
        self.away: set[str] = set()
        self.ended: list[Invitation] = []
        self.silenced: dict[str, float] = {}
        self.elsewhere: dict[str, dict[str, float]] = {}

    def silences(self) -> dict[str, float]:
        return self.silenced

    def silenced_elsewhere(self, console: str, links: Mapping[str, float]) -> None:
        self.elsewhere[console] = dict(links)

    async def stop_robot(self, name: str, press: Press) -> StopAnswer:
        self.stops.append((name, press.by.name, press.reason))
        self.presses.append(press.id)
        if name in self.away:
            return StopAnswer(True, False, 7, "the robot is away; it is sent first when the robot link is back")
        return StopAnswer(True, True, 7, "", 3, kept=True)

    def links_revoked(self, ended: list[Invitation]) -> None:
        self.ended += ended


class FakeLinks:
    def __init__(self) -> None:
        self.on_revoked: Callable[[], None] = lambda: None
        self.here: dict[str, float] = {}
        self.elsewhere: dict[str, float] = {}

    def revoke(self, link: str) -> None:
        self.here[link] = time.time() + 3600
        self.on_revoked()

    def revoked_links(self) -> dict[str, float]:
        return {**self.elsewhere, **self.here}

    def revoked_elsewhere(self, links: Mapping[str, float]) -> bool:
        fresh = {link: expires for link, expires in links.items() if link not in self.elsewhere}
        self.elsewhere.update(fresh)
        return bool(fresh)

    def keep_revoked_elsewhere(self) -> list[Invitation]:
        return []


class TestBoard(RedisBoard):
    """With its host and links at hand."""

    __test__ = False

    def __init__(self, url: str, name: str, key: str) -> None:
        self.host, self.links, self.registry = FakeHost(), FakeLinks(), CollectorRegistry()
        metrics = BoardMetrics(self.registry)
        super().__init__(url, Seal(key), self.host, self.links, metrics, f"https://{name}.example", name)

    def count(self, metric: str, **labels: str) -> float:
        return self.registry.get_sample_value(metric, labels) or 0.0


@asynccontextmanager
async def running_board(url: str, name: str, *robots: Tile, key: str = KEY) -> AsyncIterator[TestBoard]:
    board = TestBoard(url, name, key)
    board.publish(robots)
    async with asyncio.TaskGroup() as tasks:
        running = tasks.create_task(board.run())
        try:
            yield board
        finally:
            running.cancel()
