"""Keeps the consoles' states, their news, the shared audit and revoked links in Redis. A thin shell.

| key | |
|---|---|
| `lockstep:consoles` | sorted set: ids of consoles, by the time of their last sign of life |
| `lockstep:console:ID` | the state of one console; expires |
| `lockstep:audit` | capped stream: audit records |
| `lockstep:revoked` | sorted set: revoked links, by the time of their expiry |
| `lockstep:news` | the channel for news |
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import urlsplit

from redis.asyncio import Redis
from redis.asyncio.client import Pipeline, PubSub
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

from lockstep.server.federation.envelope import SIZE
from lockstep.server.federation.errors import BoardError, BoardSilent
from lockstep.server.federation.messages import MAX_PUBLISHED
from lockstep.server.federation.other_consoles import MAX_CONSOLES
from lockstep.server.federation.redis.redis_errors import RedisErrors
from lockstep.server.federation.redis.redis_private import BoundedParser

__all__ = ["RedisStore"]

PREFIX = "lockstep:"
CONSOLES = PREFIX + "consoles"
AUDIT = PREFIX + "audit"
REVOKED = PREFIX + "revoked"
NEWS = PREFIX + "news"

EXPIRES_MS = 5000  # of a console's state, after its last sign of life
REMEMBERED = 3600.0  # s an id stays in the list of consoles
AUDIT_KEPT = 10_000  # records, about
MAX_REVOKED = 5000
TIMEOUT = 2.0  # s for one exchange
HEARTBEAT = 3.0  # s without news until the connection for news is tested
CONNECTIONS = 8
MAX_ID = 64  # bytes; a longer id is not a console's


class RedisStore:
    """Enter it to use it. All methods raise BoardTrouble in bounded time, or InputTooLarge."""

    def __init__(self, url: str, timeout: float = TIMEOUT) -> None:
        self._timeout = timeout
        self._errors = RedisErrors(urlsplit(url).password or "", timeout)
        self._redis = Redis.from_url(
            url,
            protocol=2,
            parser_class=BoundedParser,
            # `RedisStore` bounds the time itself. With a bound of redis-py, writes pass through asyncio.wait_for, which
            # swallows a cancellation in Python 3.11.
            socket_timeout=None,
            socket_connect_timeout=timeout,
            retry=Retry(NoBackoff(), 0),
            max_connections=CONNECTIONS,
            health_check_interval=0,
        )

    async def __aenter__(self) -> "RedisStore":
        return self

    async def __aexit__(self, *error: object) -> None:
        await self._redis.aclose()

    async def show(self, console: str, sealed: bytes, news: bytes | None, now: float) -> None:
        """Set the state of a console; `news` tells the others to look. `now` is seconds since 1970."""
        async with self._pipeline() as commands:
            commands.set(f"{PREFIX}console:{console}", sealed, px=EXPIRES_MS)
            commands.zadd(CONSOLES, {console: now})
            commands.zremrangebyscore(CONSOLES, "-inf", now - REMEMBERED)
            commands.zremrangebyrank(CONSOLES, 0, -(MAX_CONSOLES * 4))
            if news is not None:
                commands.publish(NEWS, news)

    async def shown(self, own: str, refused: Callable[[BoardError], None]) -> AsyncIterator[bytes]:
        """Yield the states of the other living consoles; call `refused` with errors of a single one."""
        with self._errors.named():
            async with asyncio.timeout(self._timeout):
                ids = await self._redis.zrevrange(CONSOLES, 0, MAX_CONSOLES)
        others = [each for each in ids if isinstance(each, bytes) and each != own.encode() and len(each) <= MAX_ID]
        # GETRANGE, so that a value of any size costs no more than the largest valid one
        async with self._pipeline() as commands:
            for each in others:
                commands.getrange(f"{PREFIX}console:".encode() + each, 0, MAX_PUBLISHED + SIZE)
            found = await self._execute(commands)
        for each in found:
            try:
                with self._errors.named():
                    if isinstance(each, RedisError):
                        raise each
            except BoardError as error:
                refused(error)
            if isinstance(each, bytes) and each:  # empty: it has expired
                yield each

    async def farewell(self, console: str, news: bytes) -> None:
        async with self._pipeline() as commands:
            commands.delete(f"{PREFIX}console:{console}")
            commands.zrem(CONSOLES, console)
            commands.publish(NEWS, news)

    async def append(self, records: Sequence[dict[bytes, bytes]]) -> None:
        async with self._pipeline() as commands:
            for fields in records:
                entry: dict[Any, Any] = {**fields}
                commands.xadd(AUDIT, entry, maxlen=AUDIT_KEPT, approximate=True)

    async def newest(self, limit: int) -> list[dict[bytes, bytes]]:
        """Return records, newest first."""
        with self._errors.named():
            async with asyncio.timeout(self._timeout):
                entries: list[Any] = await self._redis.xrevrange(AUDIT, count=limit) or []
        return [fields for _, fields in entries if fields]

    async def revoke(self, links: Sequence[tuple[bytes, float]], news: bytes, now: float) -> None:
        """Add links: sealed ids, each with the time of its expiry."""
        async with self._pipeline() as commands:
            for sealed, expires in links:
                commands.zadd(REVOKED, {sealed: expires})
            commands.zremrangebyscore(REVOKED, "-inf", now)
            commands.publish(NEWS, news)

    async def revoked(self) -> list[bytes]:
        with self._errors.named():
            async with asyncio.timeout(self._timeout):
                found = await self._redis.zrevrange(REVOKED, 0, MAX_REVOKED - 1)
        return [each for each in found if isinstance(each, bytes)]

    async def tell(self, news: bytes) -> None:
        with self._errors.named():
            async with asyncio.timeout(self._timeout):
                await self._redis.publish(NEWS, news)

    @asynccontextmanager
    async def news(self) -> AsyncIterator[AsyncIterator[bytes]]:
        """Subscribe while entered; yield an endless iterator over the news."""
        async with self._redis.pubsub() as channel:
            with self._errors.named():
                async with asyncio.timeout(self._timeout):
                    await channel.subscribe(NEWS)
                    await channel.get_message(timeout=self._timeout)  # the answer to the subscription
            yield self._messages(channel)

    async def _messages(self, channel: PubSub) -> AsyncIterator[bytes]:
        asked = False  # True while the answer to a ping is due
        while True:
            with self._errors.named():
                message = await channel.get_message(timeout=HEARTBEAT)
                if message is None:
                    if asked:
                        raise BoardSilent("the news connection is silent")
                    async with asyncio.timeout(self._timeout):
                        await channel.ping()
            asked = message is None
            if message is not None and message["type"] == "message" and isinstance(message["data"], bytes):
                yield message["data"]

    @asynccontextmanager
    async def _pipeline(self) -> AsyncIterator[Pipeline]:
        """Send commands together on leaving, for nothing but their effect; raise the first error."""
        with self._errors.named():
            async with self._redis.pipeline(transaction=False) as commands:
                yield commands
                for each in await self._execute(commands):
                    if isinstance(each, RedisError):
                        raise each

    async def _execute(self, commands: Pipeline) -> list[Any]:
        """Return all answers, errors included."""
        if not len(commands):
            return []
        async with asyncio.timeout(self._timeout):
            answers: list[Any] = await commands.execute(raise_on_error=False)
        return answers
