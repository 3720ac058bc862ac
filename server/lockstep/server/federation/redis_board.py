"""The board in Redis: publishes the state of this console and reads the others'. Its errors affect nothing else."""

import asyncio
import secrets
import time
from collections import deque
from collections.abc import AsyncIterator, Collection, Iterable, Sequence
from contextlib import suppress

import structlog

from lockstep.server.audit.records import Actor, AuditRecord
from lockstep.server.federation.board import BoardHost, BoardState, Conflict, SharedAudit, SharedRecord, StopAnswer
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import BoardError, BoardInput, BoardSilent, BoardTrouble, BoardUnreachable
from lockstep.server.federation.messages import (
    MAX_AUDIT_LINE,
    Changed,
    Gone,
    News,
    Outcome,
    Published,
    Revoked,
    SilencedLink,
    StopReply,
    StopRequest,
    pack_news,
    pack_published,
    pack_record,
    unpack_news,
    unpack_published,
    unpack_record,
)
from lockstep.server.federation.metrics import BoardMetrics
from lockstep.server.federation.other_consoles import OtherConsoles
from lockstep.server.federation.pending_stops import PendingStops
from lockstep.server.federation.redis_store import RedisStore
from lockstep.server.federation.revocations import KnownLinks, Revocations
from lockstep.server.federation.robot_summary import Tile, loud, within_bounds
from lockstep.server.federation.settings import board_place
from lockstep.server.stop.stop_presses import Press, new_press
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.uncancelled import attempt

__all__ = ["RedisBoard"]

log = structlog.get_logger(__name__)

PERIOD = 1.0  # s between two signs of life
SPACING = 0.1  # s, at least, between two rounds
MAX_WAITING = 2048  # audit records that could not be shared yet; then the oldest are dropped
BATCH = 256
STOP_PATIENCE = 2.0  # s for all consoles that have the robots to answer
STOP_AGAIN = 0.4  # s until the request is sent again
MAX_STOPS = 32  # stops that wait for answers at the same time; further ones are sent once
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
        self._tasks: asyncio.TaskGroup | None = None  # of the session
        self._others = OtherConsoles(self.id, self.name)
        self._pending = PendingStops()
        self._tiles: tuple[Tile, ...] = ()
        self._n = 0  # of the last sign of life
        self._loud = False  # True if the others should look at once
        self._wake = asyncio.Event()
        self._waiting: deque[tuple[str, AuditRecord]] = deque()
        self._known_at = time.time()  # time of the newest knowledge of the others
        self._unknown_since: float | None = self._known_at
        self._trouble = "not connected yet"
        self._unseen = ""  # reason that this console cannot publish its state to the others
        self._unshared = ""  # reason that the audit log cannot be shared
        self._conflicts: tuple[Conflict, ...] = ()  # conflicts that the log has named

    # Board

    @property
    def state(self) -> BoardState:
        detail = self._trouble if self._unknown_since is not None else self._unseen
        conflicts = self._others.conflicts(self._own(), time.monotonic())
        return BoardState(shared=True, unknown_since=self._unknown_since, detail=detail, conflicts=conflicts)

    def publish(self, tiles: Sequence[Tile]) -> None:
        shown = tuple(within_bounds(tile, self._public_url) for tile in tiles)
        if [loud(tile) for tile in shown] != [loud(tile) for tile in self._tiles]:
            self._loud = True
            self._wake.set()
        self._tiles = shown

    def others(self) -> list[Tile]:
        return self._others.tiles(self._own(), time.monotonic())

    def record(self, robot: str, record: AuditRecord) -> None:
        if len(self._waiting) >= MAX_WAITING:
            self._waiting.popleft()
            self._metrics.lost.labels("audit").inc()
        self._waiting.append((robot, record))

    async def audit(self, limit: int) -> SharedAudit:
        if self._store is None:
            return SharedAudit([], False, self._trouble)
        try:
            entries = await self._store.newest(limit)
        except BoardError as error:
            self._count(error)
            return SharedAudit([], False, str(error))
        found: dict[
            tuple[str, str, int], SharedRecord
        ] = {}  # a record that was shared twice, after trouble, counts once
        for fields in reversed(entries):
            try:
                each = unpack_record(self._seal, fields)
            except BoardInput as error:
                self._count(error)
                continue
            found[each.console, each.robot, each.record.n] = each
        records = sorted(found.values(), key=lambda each: each.record.time)
        return SharedAudit(records, not self._unshared, self._unshared)

    async def stop(self, robots: Collection[str], press: Press) -> dict[str, StopAnswer]:
        wanted, by = tuple(sorted(set(robots))), press.by
        if not wanted:
            return {}
        request = StopRequest(
            console=self.id, request=secrets.token_hex(8), robots=wanted, by=by.name[:60], role=by.role[:60],
            link=by.link[:64], reason=press.reason[:500], press=press.id,
        )  # fmt: skip
        if self._pending.waiting >= MAX_STOPS:
            await self._say(request)
            return dict.fromkeys(wanted, TOO_MANY)
        asked = self._pending.ask(request)
        try:
            with suppress(TimeoutError):
                async with asyncio.timeout(STOP_PATIENCE):
                    await self._ask(asked.request, asked.complete)
        finally:
            self._pending.end(asked)
        silent = {robot: self._unconfirmed(robot) for robot in wanted if robot not in asked.answers}
        answers = {**asked.answers, **silent}
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
                self._count(error)
                self._lost(error)
            except* Exception:
                self._metrics.failures.labels("internal").inc()
                log.exception("the board's session failed")
                self._lost(BoardTrouble("a fault of this console"))
            await asyncio.sleep(backoff.next())

    # A session: from one connection until its loss

    async def _session(self, backoff: Backoff) -> None:
        async with RedisStore(self._url) as store, store.news() as news:
            self._revocations.begin()
            try:
                async with asyncio.TaskGroup() as tasks:
                    self._store = store
                    tasks.create_task(self._listen(store, news), name="board news")
                    tasks.create_task(self._talk(store, backoff), name="board")
                    self._tasks = tasks
            except asyncio.CancelledError:
                await self._farewell(store)
                raise
            finally:
                self._store = self._tasks = None

    async def _talk(self, store: RedisStore, backoff: Backoff) -> None:
        while True:
            self._wake.clear()
            await self._show(store)
            await self._share_audit(store)
            ended = await self._revocations.exchange(store, self._count)
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
        news = self._pack(Changed(console=self.id)) if self._loud else None
        self._loud = False
        try:
            await store.show(self.id, pack_published(self._seal, published), news, time.time())
        except (BoardSilent, BoardUnreachable):
            raise
        except BoardError as error:
            self._unseen = self._once(self._unseen, error, "this console cannot publish its state to the others")
        else:
            self._unseen = ""

    async def _share_audit(self, store: RedisStore) -> None:
        while self._waiting:
            batch = [self._waiting[place] for place in range(min(BATCH, len(self._waiting)))]
            packed = [pack_record(self._seal, self.name, robot, record) for robot, record in batch]
            fitting = [each for each in packed if sum(map(len, each.values())) <= MAX_AUDIT_LINE]
            self._metrics.lost.labels("audit").inc(len(packed) - len(fitting))
            try:
                await store.append(fitting)
            except (BoardSilent, BoardUnreachable):
                raise
            except BoardError as error:
                self._unshared = self._once(self._unshared, error, "the audit log cannot be shared")
                return
            self._unshared = ""
            for each in batch:
                if self._waiting and self._waiting[0] is each:  # else it was dropped for a newer one meanwhile
                    self._waiting.popleft()

    async def _look(self, store: RedisStore) -> None:
        async for sealed in store.shown(self.id, self._count):
            try:
                shown = unpack_published(self._seal, sealed)
                if self._others.heard(shown, time.monotonic()):
                    self._host.silenced_elsewhere(shown.id, {each.id: each.until for each in shown.silenced})
            except BoardInput as error:
                self._count(error)
            await asyncio.sleep(0)  # a turn for the sessions between any two consoles
        self._found()

    async def _listen(self, store: RedisStore, news: AsyncIterator[bytes]) -> None:
        taken, since = 0, time.monotonic()
        async for sealed in news:
            try:
                await self._hear(store, unpack_news(self._seal, sealed))
            except BoardInput as error:
                self._count(error)
            taken += 1
            if taken >= NEWS_AT_ONCE:
                if time.monotonic() - since < NEWS_PAUSE:
                    await asyncio.sleep(NEWS_PAUSE)
                taken, since = 0, time.monotonic()

    async def _hear(self, store: RedisStore, news: News) -> None:
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
                self._pending.replied(news)
            case StopRequest():
                await self._hear_stop(store, news)

    # Stops

    async def _hear_stop(self, store: RedisStore, request: StopRequest) -> None:
        """Obey or answer a request. Robots take time to answer: the news goes on meanwhile."""
        own = sorted(self._own() & set(request.robots))
        if not own:
            return
        if not self._pending.is_new(request):
            await self._reply(store, request)
        elif self._tasks is not None:
            self._tasks.create_task(self._obey(store, request, own), name="board stop")

    async def _obey(self, store: RedisStore, request: StopRequest, own: Sequence[str]) -> None:
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
        await self._reply(store, request)

    async def _reply(self, store: RedisStore, request: StopRequest) -> None:
        outcomes = self._pending.outcomes(request)
        if outcomes:
            await store.tell(self._pack(StopReply(console=self.id, request=request.request, robots=outcomes)))

    async def _ask(self, request: StopRequest, complete: asyncio.Event) -> None:
        """Repeat a request until all have answered, since Redis forgets news that nobody hears."""
        while not complete.is_set():
            await self._say(request)
            with suppress(TimeoutError):
                async with asyncio.timeout(STOP_AGAIN):
                    await complete.wait()

    async def _say(self, request: StopRequest) -> None:
        if self._store is not None:
            with suppress(BoardError):  # the session notices too
                await self._store.tell(self._pack(request))

    def _unconfirmed(self, robot: str) -> StopAnswer:
        if self._unknown_since is not None:
            why = f"other consoles are unknown ({self._trouble})"
        else:
            owner = self._others.owners([robot], time.monotonic()).get(robot, "")
            why = f"{owner} did not answer" if owner else "no console has this robot"
        return StopAnswer(False, False, 0, f"not confirmed: {why}")

    # State

    def _own(self) -> set[str]:
        return {tile.name for tile in self._tiles}

    def _pack(self, news: News) -> bytes:
        return pack_news(self._seal, news)

    def _found(self) -> None:
        """Note that the states of all other consoles were read."""
        now = time.monotonic()
        if self._unknown_since is not None:
            log.info("other consoles are known", board=board_place(self._url))
        self._unknown_since, self._known_at, self._trouble = None, time.time(), ""
        self._metrics.up.set(1)
        self._metrics.consoles.set(self._others.living(now))
        conflicts = self._others.conflicts(self._own(), now)
        for each in _without(conflicts, self._conflicts):
            log.error("two consoles claim one robot name", error=each.error, robot=each.robot, consoles=each.consoles)
        for each in _without(self._conflicts, conflicts):
            log.info("only one console claims the robot name again", robot=each.robot)
        self._conflicts = conflicts
        self._metrics.conflicts.set(len(conflicts))

    def _lost(self, error: BoardError) -> None:
        if self._unknown_since is None or self._trouble != str(error):
            log.warning(
                "other consoles are unknown", board=board_place(self._url), error=error.name, detail=error.detail
            )
        if self._unknown_since is None:
            self._unknown_since = self._known_at
        self._trouble = str(error)
        self._metrics.up.set(0)

    def _once(self, known: str, error: BoardError, what: str) -> str:
        """Count an error that does not end the session; log it when it begins."""
        self._count(error)
        if not known:
            log.warning(what, board=board_place(self._url), error=error.name, detail=error.detail)
        return f"{what}: {error}"

    def _count(self, error: BoardError) -> None:
        (self._metrics.bad_input if isinstance(error, BoardInput) else self._metrics.failures).labels(error.name).inc()

    async def _farewell(self, store: RedisStore) -> None:
        with suppress(BoardError, TimeoutError):
            async with asyncio.timeout(FAREWELL_SECONDS):
                await store.farewell(self.id, self._pack(Gone(console=self.id)))


def _first(group: BaseExceptionGroup[BoardError]) -> BoardError:
    found: BaseException = group
    while isinstance(found, BaseExceptionGroup):
        found = found.exceptions[0]
    if not isinstance(found, BoardError):
        raise TypeError(found)
    return found


def _without(some: Iterable[Conflict], known: Iterable[Conflict]) -> list[Conflict]:
    robots = {each.robot for each in known}
    return [each for each in some if each.robot not in robots]
