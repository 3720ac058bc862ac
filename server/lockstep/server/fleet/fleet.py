"""All robots of one console: their sessions, the access to them, STOP for all, and the board of other consoles."""

import asyncio
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

import structlog
from starlette.requests import HTTPConnection, Request

from lockstep.server.audit.records import AuditRecord
from lockstep.server.auth.tokens import Access, Identity, Right
from lockstep.server.control.stop.stop_silence import SILENCED
from lockstep.server.federation.board import Board
from lockstep.server.federation.memory_board import MemoryBoard
from lockstep.server.federation.robot_summary import Tile
from lockstep.server.fleet.metrics import FleetMetrics
from lockstep.server.fleet.robot_stop import Stopped, stop_robot
from lockstep.server.fleet.session import FleetSession
from lockstep.server.fleet.summaries import UNREADABLE, absent_tile, tile_of
from lockstep.server.settings import Settings
from lockstep.server.state.console_context import ConsoleContext
from lockstep.server.state.persistent_state import robot_place
from lockstep.server.stop.stop_presses import Press
from lockstep.server.telemetry.background import keep_running
from lockstep.server.util.process.gc_scheduler import sweep_forever

__all__ = ["Fleet", "fleet_caller", "fleet_of"]

log = structlog.get_logger(__name__)

LOOK_SECONDS = 1.0  # between two looks at every robot
START_SECONDS = 20.0  # wait of the console for its sessions before it answers


class Fleet:
    """All robots of one console. Enter `running` once.

    Everything but `stop_all` is called on the same loop and returns at once.

    Attributes:
        sessions: by the robots' names
        board: the board of other consoles; it never decides anything about this console's robots
    """

    def __init__(self, robots: Mapping[str, Settings]) -> None:
        self.metrics = FleetMetrics()
        self.sessions = {name: FleetSession(name, settings) for name, settings in robots.items()}
        self.board: Board = MemoryBoard()
        self.metrics.robots.set(len(self.sessions))
        self._context: ConsoleContext | None = None
        self._door: Access | None = None

    @asynccontextmanager
    async def running(self, context: ConsoleContext, board: Board) -> AsyncIterator[None]:
        """Run all sessions while entered. Waits for their starts first, but not long for one that hangs."""
        self._context, self._door, self.board = context, context.state.access.at(None), board
        directory = context.state.directory.path
        async with asyncio.TaskGroup() as tasks:
            running = [
                tasks.create_task(self._run_session(each, context, directory), name=f"robot {name}")
                for name, each in self.sessions.items()
            ]
            running += [
                tasks.create_task(context.run(), name="links"),
                tasks.create_task(keep_running("fleet", self._look, self.metrics.faults), name="fleet"),
                tasks.create_task(keep_running("board", board.run, self.metrics.faults), name="board"),
                tasks.create_task(
                    keep_running("sweeper", lambda: sweep_forever(self._ended, self._moving), self.metrics.faults),
                    name="sweeper",
                ),
            ]
            settled = [tasks.create_task(each.settled.wait()) for each in self.sessions.values()]
            await asyncio.wait(settled, timeout=START_SECONDS)
            yield
            for task in (*running, *settled):
                task.cancel()

    # access

    def caller(self, connection: HTTPConnection) -> Right:
        """Return the right that a request brings. Raises AccessError, StateUnavailable; to stop, the first only."""
        if self._door is None:
            raise TypeError("the fleet is not running")
        bearer = self._door.bearer_to_stop if connection.scope["path"].endswith("/stop") else self._door.bearer
        return bearer(connection.headers.get("authorization"))

    @property
    def lets_in(self) -> bool:
        """False while the revoked links are unknown."""
        return self._context is None or not self._context.state.invitations.trouble

    # overview

    def own_tiles(self) -> list[Tile]:
        now = time.monotonic()
        return [self._tile(session, now) for session in self.sessions.values()]

    def tiles(self, identity: Identity) -> list[Tile]:
        """Return the tiles of all robots that this link may see, other consoles' too; by name."""
        found = [tile for tile in (*self.own_tiles(), *self.board.others()) if identity.may_see(tile.name)]
        return sorted(found, key=lambda tile: (tile.name, tile.console))

    def _tile(self, session: FleetSession, now: float) -> Tile:
        """Return the tile of a robot. A fault with one robot must not hide the others."""
        here = session.dependencies
        if here is None:
            return absent_tile(session.name)
        try:
            return tile_of(here, session.rate_meter, now)
        except Exception as error:
            here.metrics.faults.caught("tile", error, robot=session.name)
            return absent_tile(session.name, UNREADABLE)

    # STOP

    async def stop_all(self, identity: Identity, press: Press) -> list[Stopped]:
        """Stop every robot that this link may see, all at once: this console's, and those of other consoles."""
        self.metrics.stops.inc()
        elsewhere = {tile.name: tile.console for tile in self.board.others() if identity.may_see(tile.name)}
        faults = self.metrics.faults
        stopping = [
            stop_robot(session, press, faults) for name, session in self.sessions.items() if identity.may_see(name)
        ]
        own, others = await asyncio.gather(asyncio.gather(*stopping), self._stop_elsewhere(elsewhere, press))
        self.board.publish(self.own_tiles())
        return sorted([*own, *others])

    async def _stop_elsewhere(self, robots: Mapping[str, str], press: Press) -> list[Stopped]:
        """Stop robots of other consoles. `robots`: their names, with the consoles that have them."""
        if not robots:
            return []
        if self._context is not None and self._context.is_silenced(press.by.link):
            return [Stopped(name, False, 0, SILENCED, 0, console) for name, console in robots.items()]
        answers = await self.board.stop(robots.keys(), press)
        return [
            Stopped(name, answer.delivered, answer.event, answer.detail, answer.number, robots[name], answer.kept)
            for name, answer in answers.items()
        ]

    # background tasks

    async def _run_session(self, session: FleetSession, context: ConsoleContext, directory: Path) -> None:
        """Run a session, with its own directory for recordings and audit."""
        await session.run(context, robot_place(directory, session.name), self.metrics, self._recorded)

    def _recorded(self, robot: str, record: AuditRecord) -> None:
        try:
            self.board.record(robot, record)
        except Exception as error:
            self.metrics.faults.caught("board", error, robot=robot)

    async def _look(self) -> None:
        while True:
            now = time.monotonic()
            for session in self.sessions.values():
                session.look(now)
            self.board.publish(self.own_tiles())
            await asyncio.sleep(LOOK_SECONDS)

    def _ended(self) -> int:
        return sum(session.ended for session in self.sessions.values())

    def _moving(self) -> bool:
        return any(session.moving for session in self.sessions.values())


def fleet_of(connection: HTTPConnection) -> Fleet:
    """Return the fleet that a request came to."""
    found = connection.app.state.fleet
    if not isinstance(found, Fleet):
        raise TypeError("the app has no fleet")
    return found


async def fleet_caller(connection: Request) -> Right:
    """Return the caller's right at the fleet. Raises AccessError."""
    return fleet_of(connection).caller(connection)
