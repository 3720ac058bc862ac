"""Which relay the session goes to first, without any: the engine only notes where it is asked to publish."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from lockstep.server.auth.tokens import Identity
from lockstep.server.sfu.coordinator import SfuCoordinator
from lockstep.server.sfu.errors import RelayError
from lockstep.server.sfu.publication import Publication, Watched
from lockstep.server.sfu.settings import RelaySettings
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.tickets import RelayTicket


class Relays:
    """An engine whose relays are there or not."""

    def __init__(self) -> None:
        self.down: set[str] = set()
        self.fails_as_it_ends = False
        self.tried: list[str] = []
        self.carrying: dict[str, Publication] = {}
        self.changed = asyncio.Event()
        self.passed_on = asyncio.Event()
        self.odd = False

    @asynccontextmanager
    async def publish(self, station: SfuServer, feed: int) -> AsyncIterator[Publication]:
        self.tried.append(station.name)
        if station.name in self.down:
            raise RelayError("not there")
        publication = self.carrying[station.name] = Publication(feed, [], lambda _: None)
        self.changed.set()
        try:
            yield publication
        finally:
            del self.carrying[station.name]
            if self.fails_as_it_ends:
                raise RelayError("no answer to the farewell")

    @asynccontextmanager
    async def pass_on(self, origin: SfuServer, station: SfuServer, publication: Publication) -> AsyncIterator[Watched]:
        self.passed_on.set()
        if self.odd:
            raise UnicodeError("no host of that name")
        await asyncio.Event().wait()  # no relay is ever reached from another one here
        yield publication

    def ticket(self, station: SfuServer) -> RelayTicket:
        raise NotImplementedError

    async def until_carried_by(self, name: str) -> None:
        async with asyncio.timeout(20):
            while name not in self.carrying:
                self.changed.clear()
                await self.changed.wait()

    def kill(self, name: str) -> None:
        self.down.add(name)
        self.carrying[name].end("killed")


class Watching:
    relay, role = "0", "observer"
    identity = Identity("observer", "", "link", 1000.0)


def _good(link: str, expires: float) -> bool:
    return False


async def test_of_two_relays_that_failed_lately_the_one_that_failed_just_now_is_not_tried_first() -> None:
    relays, now = Relays(), [100.0]
    settings = RelaySettings(relay=("janus:ws://a.example/1", "janus:ws://b.example/1"), observers_direct=0)
    coordinator = SfuCoordinator(settings, relays, [Watching()], _good, lambda: now[0])
    asked = asyncio.create_task(coordinator.ticket(None, ""))
    running = asyncio.create_task(coordinator.run())
    try:
        for killed, next_one in (("0", "1"), ("1", "0"), ("0", "1")):
            await relays.until_carried_by(killed)
            relays.down.clear()
            now[0] += 12.0  # less than distrust lasts
            relays.tried.clear()
            relays.kill(killed)
            await relays.until_carried_by(next_one)
            assert relays.tried == [next_one]
    finally:
        for task in (asked, running):
            task.cancel()
        await asyncio.gather(asked, running, return_exceptions=True)


async def test_a_relay_that_does_not_answer_the_farewell_does_not_keep_the_console_from_ending() -> None:
    relays = Relays()
    settings = RelaySettings(relay=("janus:ws://a.example/1",), observers_direct=0)
    coordinator = SfuCoordinator(settings, relays, [Watching()], _good, lambda: 100.0)
    asked = asyncio.create_task(coordinator.ticket(None, ""))
    running = asyncio.create_task(coordinator.run())
    await relays.until_carried_by("0")
    relays.fails_as_it_ends = True
    for task in (asked, running):
        task.cancel()
    _, going_on = await asyncio.wait([running], timeout=20)
    relays.fails_as_it_ends = False
    running.cancel()
    await asyncio.gather(asked, running, return_exceptions=True)
    assert not going_on
    assert relays.tried == ["0"]


async def test_a_fault_on_the_way_to_one_more_relay_ends_nothing_at_the_first() -> None:
    relays = Relays()
    relays.odd = True
    settings = RelaySettings(relay=("janus:ws://a.example/1", "janus:ws://b.example/1"), observers_direct=0)
    coordinator = SfuCoordinator(settings, relays, [Watching()], _good, lambda: 100.0)
    asked = asyncio.create_task(coordinator.ticket(None, ""))
    running = asyncio.create_task(coordinator.run())
    try:
        await relays.until_carried_by("0")
        for _ in range(2):  # it is tried again
            relays.passed_on.clear()
            async with asyncio.timeout(20):
                await relays.passed_on.wait()
        assert [each.trouble for each in coordinator.servers] == ["", "UnicodeError"]
        assert relays.tried == ["0"]
        assert not relays.carrying["0"].ended.is_set()
    finally:
        for task in (asked, running):
            task.cancel()
        await asyncio.gather(asked, running, return_exceptions=True)
