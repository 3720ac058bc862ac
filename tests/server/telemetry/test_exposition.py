"""The text of /metrics: a family at a time, once for all who ask meanwhile, never older than the question."""

import asyncio

import pytest
from prometheus_client import CollectorRegistry, Counter, Gauge, generate_latest

from lockstep.server.telemetry.exposition import Exposition

FAMILIES = 5


class Rig:
    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.first = Counter("first", "Read at once", registry=self.registry)
        for number in range(FAMILIES - 1):
            Gauge(f"gauge_{number}", "Of no interest", registry=self.registry)
        self.exposition = Exposition(self.registry)
        self.made = 0

    def count(self) -> None:
        self.made += 1

    async def ask(self) -> bytes:
        return await self.exposition.text(self.count)


def at_once(registry: CollectorRegistry) -> bytes:
    """As the library writes it, but for when counters were made."""
    lines = generate_latest(registry).decode().splitlines(keepends=True)
    return "".join(line for line in lines if "_created" not in line).encode()


@pytest.fixture
async def rig() -> Rig:
    return Rig()


async def test_it_is_what_the_library_would_have_written_at_once_but_for_when_counters_were_made(rig: Rig) -> None:
    assert await rig.ask() == at_once(rig.registry)


async def test_others_have_their_turn_between_two_families(rig: Rig) -> None:
    turns = 0
    asking = asyncio.create_task(rig.ask())
    while not asking.done():
        await asyncio.sleep(0)
        turns += 1
    assert turns >= FAMILIES


async def test_who_asks_while_it_is_made_shares_the_next_one_and_sees_what_he_counted(rig: Rig) -> None:
    early = asyncio.create_task(rig.ask())
    await asyncio.sleep(0)
    rig.first.inc()  # its family is written already
    late = [asyncio.create_task(rig.ask()) for _ in range(10)]
    assert b"first_total 0.0" in await early
    assert all(b"first_total 1.0" in text for text in await asyncio.gather(*late))
    assert rig.made == 2


async def test_who_goes_away_while_it_is_made_leaves_no_half_of_it_to_others(rig: Rig) -> None:
    early = asyncio.create_task(rig.ask())
    await asyncio.sleep(0)
    middle = asyncio.create_task(rig.ask())
    late = asyncio.create_task(rig.ask())
    await early
    await asyncio.sleep(0)
    middle.cancel()
    assert await late == at_once(rig.registry)
    with pytest.raises(asyncio.CancelledError):
        await middle
