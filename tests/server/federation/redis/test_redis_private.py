"""Pins what `server/lockstep/server/federation/redis/redis_private.py` leans on in redis-py."""

import inspect

from redis._parsers.base import _AsyncRESPBase
from redis._parsers.resp2 import _AsyncRESP2Parser
from redis.asyncio import Redis

from lockstep.server.federation.redis.redis_private import BoundedParser


def test_every_string_is_read_by_the_method_that_is_bounded() -> None:
    assert issubclass(_AsyncRESP2Parser, _AsyncRESPBase)
    assert "await self._read(int(response))" in inspect.getsource(_AsyncRESP2Parser._read_response)
    assert "_read" not in vars(_AsyncRESP2Parser)


async def test_a_connection_reads_by_our_parser() -> None:
    async with Redis.from_url("redis://127.0.0.1:1", protocol=2, parser_class=BoundedParser) as client:
        connection = client.connection_pool.make_connection()  # type: ignore[no-untyped-call]
        assert isinstance(connection._parser, BoundedParser)
