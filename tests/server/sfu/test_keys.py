"""Who is told what lets into a relay, and what becomes of it when one of their links ends."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from lockstep.server.auth.tokens import Identity
from lockstep.server.sfu import coordinator
from lockstep.server.sfu.coordinator import SfuCoordinator
from lockstep.server.sfu.key_holders import RENEW_SECONDS, STRAY_SECONDS
from lockstep.server.sfu.publication import Publication
from lockstep.server.sfu.settings import RelaySettings
from lockstep.server.sfu.sfu_server import SfuServer
from lockstep.server.sfu.tickets import RelayTicket
from tests.server.sfu.test_coordinator import Relays


class _Keyed(Relays):
    """An engine whose tickets have the feed for a PIN."""

    def ticket(self, station: SfuServer) -> RelayTicket:
        return RelayTicket(
            relay=station.name, url="ws://a.example", feed=station.feed, streams=[], room=1, pin=str(station.feed)
        )


class _Watcher:
    relay, role = "0", "observer"

    def __init__(self, link: str, expires: float) -> None:
        self.identity = Identity("observer", "", link, expires)


class _Hall:
    """A desk with one relay, its audience and a clock that is set by hand."""

    def __init__(self) -> None:
        self.relays = _Keyed()
        self.here: list[_Watcher] = []
        self.ended: set[str] = set()
        self.faults: list[Exception] = []
        self.now = 100.0
        settings = RelaySettings(relay=("janus:ws://a.example/1",), observers_direct=0)
        self.coordinator = SfuCoordinator(settings, self.relays, self.here, self.has_ended, lambda: self.now)

    def has_ended(self, link: str, expires: float) -> bool:
        if self.faults:
            raise self.faults.pop()
        return link in self.ended or self.now >= expires

    def watch(self, link: str, expires: float = 1e9) -> _Watcher:
        watcher = _Watcher(link, expires)
        self.here.append(watcher)
        return watcher

    async def another(self, known: Publication) -> Publication:
        """The publication that follows."""
        async with asyncio.timeout(20):
            while self.relays.carrying.get("0", known) is known or not next(iter(self.coordinator.servers)).live:  # noqa: ASYNC110
                await asyncio.sleep(0)
        return self.relays.carrying["0"]


@asynccontextmanager
async def _hall(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[_Hall]:
    monkeypatch.setattr(coordinator, "LOOK_SECONDS", 0.01)
    hall = _Hall()
    hall.watch("first")
    async with asyncio.TaskGroup() as tasks:
        asked = tasks.create_task(hall.coordinator.ticket(None, ""))
        running = tasks.create_task(hall.coordinator.run())
        await hall.relays.until_carried_by("0")
        await asked
        yield hall
        running.cancel()


async def test_when_the_link_of_anybody_who_has_the_key_ends_it_is_made_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    async with _hall(monkeypatch) as hall:
        watcher = hall.watch("mallory")
        first = hall.relays.carrying["0"]
        ticket = hall.coordinator.key(watcher)
        assert isinstance(ticket, RelayTicket)
        assert ticket.pin == str(first.feed)
        hall.here.remove(watcher)  # the line is closed, the key is kept
        hall.ended.add("mallory")
        second = await hall.another(first)
        assert first.why == coordinator.ENDED
        assert second.feed != first.feed


async def test_when_the_link_of_somebody_who_has_the_key_expires_it_is_made_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with _hall(monkeypatch) as hall:
        first = hall.relays.carrying["0"]
        hall.coordinator.key(hall.watch("mallory", expires=hall.now + 5))
        hall.now += 6
        second = await hall.another(first)
        assert first.why == coordinator.ENDED
        assert second.feed != first.feed


async def test_a_fault_of_the_task_that_looks_for_ended_links_makes_the_publication_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with _hall(monkeypatch) as hall:
        first = hall.relays.carrying["0"]
        hall.coordinator.key(hall.here[0])
        hall.faults.append(RuntimeError("a fault of the console's own"))
        second = await hall.another(first)
        hall.coordinator.key(hall.watch("mallory", expires=hall.now + 5))
        hall.now += 6
        assert (await hall.another(second)).feed != second.feed, "ended links are looked for again"


async def test_the_end_of_a_link_whose_holder_never_had_the_key_disturbs_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with _hall(monkeypatch) as hall:
        hall.coordinator.key(hall.here[0])
        hall.ended.add("stranger")
        for _ in range(5):
            await asyncio.sleep(coordinator.LOOK_SECONDS)
        assert not hall.relays.carrying["0"].ended.is_set()


async def test_who_keeps_the_key_and_leaves_is_shut_out_after_a_while_and_not_every_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with _hall(monkeypatch) as hall:
        first = hall.relays.carrying["0"]
        watcher = hall.watch("mallory")
        hall.coordinator.key(watcher)
        hall.here.remove(watcher)
        hall.now += STRAY_SECONDS + 1
        for _ in range(5):
            await asyncio.sleep(coordinator.LOOK_SECONDS)
        assert not first.ended.is_set(), "for one who leaves nobody is disturbed at once"
        hall.now += RENEW_SECONDS
        second = await hall.another(first)
        assert first.why == coordinator.STRAY
        hall.coordinator.key(hall.here[0])
        hall.now += RENEW_SECONDS + STRAY_SECONDS
        for _ in range(5):
            await asyncio.sleep(coordinator.LOOK_SECONDS)
        assert not second.ended.is_set(), "who has a line to the console is no stray"


async def test_a_relay_that_carries_nothing_has_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    async with _hall(monkeypatch) as hall:
        watcher = hall.watch("late")
        watcher.relay = "7"
        assert hall.coordinator.key(watcher) is None
