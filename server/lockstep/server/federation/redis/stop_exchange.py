"""Carries STOPs between consoles through the board: asks the others, and obeys them."""

import asyncio
import secrets
from collections.abc import Collection, Sequence
from contextlib import suppress

from lockstep.server.audit.records import Actor
from lockstep.server.federation.board import BoardHost, StopAnswer
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import BoardError
from lockstep.server.federation.messages import News, Outcome, StopReply, StopRequest, pack_news
from lockstep.server.federation.pending_stops import PendingStops
from lockstep.server.federation.redis.redis_store import RedisStore
from lockstep.server.stop.stop_presses import Press, new_press

__all__ = ["StopExchange"]

STOP_PATIENCE = 2.0  # s for all consoles that have the robots to answer
STOP_AGAIN = 0.4  # s until the request is sent again
MAX_STOPS = 32  # stops that wait for answers at the same time; further ones are sent once


class StopExchange:
    """The stops of one console at others', and of others at this one's. Call `begin` and `end` with each session."""

    def __init__(self, console: str, seal: Seal, host: BoardHost) -> None:
        """`console`: the id of this one."""
        self._console = console
        self._seal = seal
        self._host = host
        self._pending = PendingStops()
        self._store: RedisStore | None = None  # None while there is no session
        self._tasks: asyncio.TaskGroup | None = None  # of the session

    def begin(self, store: RedisStore, tasks: asyncio.TaskGroup) -> None:
        self._store, self._tasks = store, tasks

    def end(self) -> None:
        self._store = self._tasks = None

    async def ask(self, robots: Collection[str], press: Press) -> dict[str, StopAnswer] | None:
        """Ask other consoles to stop `robots`; return the answers that have come in time.

        None: too many stops wait for answers. The request was sent once.
        """
        by = press.by
        request = StopRequest(
            console=self._console, request=secrets.token_hex(8), robots=tuple(sorted(robots)), by=by.name[:60],
            role=by.role[:60], link=by.link[:64], reason=press.reason[:500], press=press.id,
        )  # fmt: skip
        if self._pending.waiting >= MAX_STOPS:
            await self._tell(request)
            return None
        asked = self._pending.ask(request)
        try:
            with suppress(TimeoutError):
                async with asyncio.timeout(STOP_PATIENCE):
                    await self._repeat(asked.request, asked.complete)
        finally:
            self._pending.end(asked)
        return asked.answers

    def replied(self, reply: StopReply) -> None:
        """Take another console's answer."""
        self._pending.replied(reply)

    async def heard(self, request: StopRequest, own: Collection[str]) -> None:
        """Obey or answer a request of another console. Robots take time to answer: the news goes on meanwhile.

        `own`: the robots of this console
        """
        wanted = sorted(set(own) & set(request.robots))
        if not wanted:
            return
        if not self._pending.is_new(request):
            await self._reply(request)
        elif self._tasks is not None:
            self._tasks.create_task(self._obey(request, wanted), name="board stop")

    async def _obey(self, request: StopRequest, own: Sequence[str]) -> None:
        press = new_press(Actor(request.by, request.role, "", request.link), "board", request.reason, request.press)
        answers = await asyncio.gather(*(self._host.stop_robot(robot, press) for robot in own))
        outcomes = tuple(
            Outcome(
                robot=robot,
                delivered=each.delivered,
                event=each.event,
                number=each.number,
                detail=each.detail,
                kept=each.kept,
            )
            for robot, each in zip(own, answers, strict=True)
        )
        self._pending.obeyed(request, outcomes)
        await self._reply(request)

    async def _reply(self, request: StopRequest) -> None:
        outcomes = self._pending.outcomes(request)
        if outcomes and self._store is not None:
            reply = StopReply(console=self._console, request=request.request, robots=outcomes)
            await self._store.tell(pack_news(self._seal, reply))

    async def _repeat(self, request: StopRequest, complete: asyncio.Event) -> None:
        """Repeat a request until all have answered, since Redis forgets news that nobody hears."""
        while not complete.is_set():
            await self._tell(request)
            with suppress(TimeoutError):
                async with asyncio.timeout(STOP_AGAIN):
                    await complete.wait()

    async def _tell(self, news: News) -> None:
        if self._store is not None:
            with suppress(BoardError):  # the session notices too
                await self._store.tell(pack_news(self._seal, news))
