"""Which relays are usable, and which is tried first."""

import asyncio

from lockstep.server.sfu.publication import Publication
from lockstep.server.sfu.relay_url import RelayUrl
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.sfu_servers import DISTRUST_SECONDS, SfuServers
from tests.waiting import PATIENCE

FEED = Publication(7, [], lambda _: None)


def _servers(now: list[float]) -> SfuServers:
    url = RelayUrl("ws://a.example", 1)
    return SfuServers([SfuServer(str(number), url, "wss://a.example") for number in range(3)], lambda: now[0])


async def test_those_that_failed_lately_are_tried_last_the_latest_failure_at_the_end() -> None:
    now = [1000.0]
    servers = _servers(now)
    tried = []
    for _ in range(4):
        first = servers.first_to_try()
        tried.append(first.name)
        servers.failed(first, "dead")
        now[0] += 1.0
    assert tried == ["0", "1", "2", "0"]
    now[0] += DISTRUST_SECONDS
    assert servers.first_to_try().name == "0"


async def test_a_relay_that_carries_the_session_is_waited_for_and_a_lost_one_is_not_usable() -> None:
    now = [1000.0]
    servers = _servers(now)
    one = servers.by_name("1")
    assert one is not None
    async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
        waiting = tasks.create_task(servers.usable("", PATIENCE))
        await asyncio.sleep(0)
        servers.carries(one, FEED)
        assert await waiting == [one]
    assert await servers.usable("1-7", 0.0) == []
    servers.gone(one, "nobody watches")
    assert (await servers.usable("", 0.0), one.trouble) == ([], "nobody watches")
