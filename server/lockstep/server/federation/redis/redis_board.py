"""The board in Redis: publishes the state of this console and reads the others'. Its errors affect nothing else."""

import asyncio
import secrets
import time
from collections.abc import AsyncIterator, Collection, Sequence
from contextlib import suppress

import structlog

from lockstep.server.audit.records import AuditRecord
from lockstep.server.federation.board import BoardHost, BoardState, SharedAudit, StopAnswer
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import BoardError, BoardInput, BoardSilent, BoardTrouble, BoardUnreachable
from lockstep.server.federation.messages import (
    Changed,
    Gone,
    News,
    Published,
    Revoked,
    SilencedLink,
    StopReply,
    StopRequest,
    pack_news,
    pack_published,
    unpack_news,
    unpack_published,
)
from lockstep.server.federation.metrics import BoardMetrics
from lockstep.server.federation.other_consoles import OtherConsoles
from lockstep.server.federation.redis.audit_exchange import AuditExchange
from lockstep.server.federation.redis.board_health import BoardHealth
from lockstep.server.federation.redis.redis_store import RedisStore
from lockstep.server.federation.redis.stop_exchange import StopExchange
from lockstep.server.federation.revocations import KnownLinks, Revocations
from lockstep.server.federation.robot_summary import Tile, loud, within_bounds
from lockstep.server.federation.settings import board_place
from lockstep.server.stop.stop_presses import Press
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.uncancelled import attempt

__all__ = ["RedisBoard"]

log = structlog.get_logger(__name__)

PERIOD = 1.0  # s between two signs of life
SPACING = 0.1  # s, at least, between two rounds
NEWS_AT_ONCE = 20  # messages, then a pause: a flood of news takes no more than its share of the loop
NEWS_PAUSE = 0.01
FAREWELL_SECONDS = 0.5
TOO_MANY = StopAnswer(False, False, 0, "not confirmed: the stop was sent, but too many stops wait for answers")


class RedisBoard:
    """A `Board`. Each connection to Redis is a separate session, retried with growing pauses."""

    def __init__(
        self, url: str, seal: Seal, host: BoardHost, links: KnownLinks, metrics: BoardMetrics, public_url: str,
        name: str,
    ) -> None:  # fmt: skip
        self.id = secrets.token_hex(8)
        self.name = f"{name}-{self.id[:4]}"  # two consoles of one machine must not look like one
        self._url = url
        self._seal = seal
        self._host = host
        self._revocations = Revocations(links, seal, self.id)
        self._metrics = metrics
        self._public_url = public_url
        self._store: RedisStore | None = None  # None while there is no session
        self._health = BoardHealth(board_place(url), metrics)
        self._audit = AuditExchange(self.name, seal, self._health, metrics)
        self._stops = StopExchange(self.id, seal, host)
        self._others = OtherConsoles(self.id, self.name)
        self._tiles: tuple[Tile, ...] = ()
        self._own: set[str] = set()  # names of the robots of `_tiles`
        self._n = 0  # of the last sign of life
        self._loud = False  # True if the others should look at once
        self._wake = asyncio.Event()
        self._unseen = ""  # reason that this console cannot publish its state to the others

    # Board

    @property
    def state(self) -> BoardState:
        unknown_since = self._health.unknown_since
        detail = self._health.trouble if unknown_since is not None else self._unseen
        conflicts = self._others.conflicts(self._own, time.monotonic())
        return BoardState(shared=True, unknown_since=unknown_since, detail=detail, conflicts=conflicts)

    def publish(self, tiles: Sequence[Tile]) -> None:
        shown = tuple(within_bounds(tile, self._public_url) for tile in tiles)
        if [loud(tile) for tile in shown] != [loud(tile) for tile in self._tiles]:
            self._loud = True
            self._wake.set()
        self._tiles, self._own = shown, {tile.name for tile in shown}

    def others(self) -> list[Tile]:
        return self._others.tiles(self._own, time.monotonic())

    def record(self, robot: str, record: AuditRecord) -> None:
        self._audit.record(robot, record)

    async def audit(self, limit: int) -> SharedAudit:
        if self._store is None:
            return SharedAudit([], False, self._health.trouble)
        return await self._audit.newest(self._store, limit)

    async def stop(self, robots: Collection[str], press: Press) -> dict[str, StopAnswer]:
        wanted = set(robots)
        if not wanted:
            return {}
        answers = await self._stops.ask(wanted, press)
        if answers is None:
            return dict.fromkeys(sorted(wanted), TOO_MANY)
        silent = {robot: self._unconfirmed(robot) for robot in sorted(wanted) if robot not in answers}
        answers = {**answers, **silent}
        for each in answers.values():
            self._metrics.stops.labels("unconfirmed" if not each.confirmed else "confirmed").inc()
        return answers

    async def run(self) -> None:
        backoff = Backoff(0.2, 2.0)
        self._revocations.listen(self._wake.set)
        while True:
            try:
                await attempt(self._session(backoff))
            except* BoardError as group:
                error = _first(group)
                self._health.count(error)
                self._health.lost(error)
            except* Exception:
                self._metrics.failures.labels("internal").inc()
                log.exception("the board's session failed")
                self._health.lost(BoardTrouble("a fault of this console"))
            await asyncio.sleep(backoff.next())

    # A session: from one connection until its loss

    async def _session(self, backoff: Backoff) -> None:
        async with RedisStore(self._url) as store, store.news() as news:
            self._revocations.begin()
            try:
                async with asyncio.TaskGroup() as tasks:
                    self._store = store
                    tasks.create_task(self._listen(news), name="board news")
                    tasks.create_task(self._talk(store, backoff), name="board")
                    self._stops.begin(store, tasks)
            except asyncio.CancelledError:
                with suppress(BoardError, TimeoutError):
                    async with asyncio.timeout(FAREWELL_SECONDS):
                        await store.farewell(self.id, pack_news(self._seal, Gone(console=self.id)))
                raise
            finally:
                self._store = None
                self._stops.end()

    async def _talk(self, store: RedisStore, backoff: Backoff) -> None:
        while True:
            self._wake.clear()
            await self._show(store)
            await self._audit.share(store)
            ended = await self._revocations.exchange(store, self._health.count)
            if ended is not None:
                self._host.links_revoked(ended)
            await self._look(store)
            backoff.healthy()
            await asyncio.sleep(SPACING)
            with suppress(TimeoutError):
                async with asyncio.timeout(PERIOD - SPACING):
                    await self._wake.wait()

    async def _show(self, store: RedisStore) -> None:
        self._n += 1
        silenced = tuple(SilencedLink(id=link, until=until) for link, until in self._host.silences().items())
        published = Published(id=self.id, name=self.name, n=self._n, robots=self._tiles, silenced=silenced)
        news = pack_news(self._seal, Changed(console=self.id)) if self._loud else None
        self._loud = False
        try:
            await store.show(self.id, pack_published(self._seal, published), news, time.time())
        except (BoardSilent, BoardUnreachable):
            raise
        except BoardError as error:
            self._unseen = self._health.once(self._unseen, error, "this console cannot publish its state to the others")
        else:
            self._unseen = ""

    async def _look(self, store: RedisStore) -> None:
        async for sealed in store.shown(self.id, self._health.count):
            try:
                shown = unpack_published(self._seal, sealed)
                if self._others.heard(shown, time.monotonic()):
                    self._host.silenced_elsewhere(shown.id, {each.id: each.until for each in shown.silenced})
            except BoardInput as error:
                self._health.count(error)
            await asyncio.sleep(0)  # a turn for the sessions between any two consoles
        now = time.monotonic()
        self._health.found(self._others.living(now), self._others.conflicts(self._own, now))

    async def _listen(self, news: AsyncIterator[bytes]) -> None:
        taken, since = 0, time.monotonic()
        async for sealed in news:
            try:
                await self._hear(unpack_news(self._seal, sealed))
            except BoardInput as error:
                self._health.count(error)
            taken += 1
            if taken >= NEWS_AT_ONCE:
                if time.monotonic() - since < NEWS_PAUSE:
                    await asyncio.sleep(NEWS_PAUSE)
                taken, since = 0, time.monotonic()

    async def _hear(self, news: News) -> None:
        if news.console == self.id:
            return
        match news:
            case Changed():
                self._wake.set()
            case Gone():
                self._others.gone(news.console)
            case Revoked():
                self._revocations.look()
                self._wake.set()
            case StopReply():
                self._stops.replied(news)
            case StopRequest():
                await self._stops.heard(news, self._own)

    def _unconfirmed(self, robot: str) -> StopAnswer:
        if self._health.unknown_since is not None:
            why = f"other consoles are unknown ({self._health.trouble})"
        else:
            owner = self._others.owners([robot], time.monotonic()).get(robot, "")
            why = f"{owner} did not answer" if owner else "no console has this robot"
        return StopAnswer(False, False, 0, f"not confirmed: {why}")


def _first(group: BaseExceptionGroup[BoardError]) -> BoardError:
    found: BaseException = group
    while isinstance(found, BaseExceptionGroup):
        found = found.exceptions[0]
    if not isinstance(found, BoardError):
        raise TypeError(found)
    return found
