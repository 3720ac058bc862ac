"""Connections race whose handshakes may meet losses."""

import asyncio
from collections.abc import Callable

import pytest

from lockstep.robot_bridge.dial.opening_race import LATE, MOST, late_after, open_first

NOW = 0.0  # s: another is begun at once
NEVER = 1e6


class Openings:
    """Each is open when the test says so."""

    def __init__(self, late: float) -> None:
        self.late = late
        self.slow: asyncio.Event | None = None  # one that is cancelled ends when this is set
        self.ways: list[asyncio.Future[str]] = []
        self.cancelled = 0
        self.discarded: list[str] = []
        self.grown = asyncio.Condition()

    async def open(self, on_its_way: Callable[[float], None]) -> str:
        self.ways.append(asyncio.get_running_loop().create_future())
        mine = self.ways[-1]
        on_its_way(self.late)
        async with self.grown:
            self.grown.notify_all()
        try:
            return await mine
        except asyncio.CancelledError:
            self.cancelled += 1
            if self.slow is not None:
                await self.slow.wait()
            raise

    async def wait_for(self, begun: int) -> None:
        async with asyncio.timeout(20), self.grown:
            await self.grown.wait_for(lambda: len(self.ways) >= begun)

    def race(self) -> asyncio.Task[str]:
        return asyncio.create_task(open_first(self.open, self.discarded.append))


async def test_one_that_is_late_gets_another_beside_it_and_the_first_that_is_open_wins() -> None:
    openings = Openings(NOW)
    race = openings.race()
    await openings.wait_for(2)
    openings.ways[1].set_result("second")
    assert await race == "second"
    assert openings.cancelled == len(openings.ways) - 1
    assert openings.discarded == []


async def test_one_that_is_in_time_stays_alone() -> None:
    openings = Openings(NEVER)
    race = openings.race()
    await openings.wait_for(1)
    openings.ways[0].set_result("first")
    assert await race == "first"
    assert len(openings.ways) == 1


async def test_few_are_opened_at_once_and_none_is_given_up_for_another() -> None:
    openings = Openings(NOW)
    race = openings.race()
    await openings.wait_for(MOST)
    for _ in range(20):
        await asyncio.sleep(0)  # any that were to come would be there
    assert (len(openings.ways), openings.cancelled) == (MOST, 0)
    race.cancel()
    with pytest.raises(asyncio.CancelledError):
        await race
    assert openings.cancelled == MOST


async def test_two_that_are_open_in_one_moment_are_one_connection() -> None:
    openings = Openings(NOW)
    race = openings.race()
    await openings.wait_for(2)
    openings.ways[0].set_result("first")
    openings.ways[1].set_result("second")
    assert await race == "first"
    assert openings.discarded == ["second"]


async def test_a_refusal_ends_the_race_of_one() -> None:
    openings = Openings(NEVER)
    race = openings.race()
    await openings.wait_for(1)
    openings.ways[0].set_exception(ConnectionRefusedError("no"))
    with pytest.raises(ConnectionRefusedError):
        await race


async def test_one_that_fails_leaves_the_other_to_be_opened_and_the_first_error_counts() -> None:
    openings = Openings(NOW)
    race = openings.race()
    await openings.wait_for(2)
    openings.ways[1].set_exception(ConnectionRefusedError("too many"))
    await asyncio.sleep(0)
    openings.ways[0].set_result("first")
    assert await race == "first"
    openings = Openings(NOW)
    race = openings.race()
    await openings.wait_for(2)
    openings.ways[1].set_exception(ConnectionRefusedError("first"))
    await asyncio.sleep(0)
    openings.ways[0].set_exception(ConnectionResetError("second"))
    with pytest.raises(ConnectionRefusedError, match="first"):
        await race


async def test_a_race_that_is_cancelled_begins_no_other() -> None:
    openings = Openings(0.01)
    openings.slow = asyncio.Event()
    race = openings.race()
    await openings.wait_for(1)
    race.cancel()
    later = asyncio.Event()
    asyncio.get_running_loop().call_later(0.05, later.set)  # behind the timer of the other one, were it still there
    await later.wait()
    openings.slow.set()
    with pytest.raises(asyncio.CancelledError):
        await race
    assert len(openings.ways) == 1


def test_a_handshake_is_late_after_more_round_trips_than_it_takes() -> None:
    assert late_after(0.001) == LATE
    assert late_after(0.6) == pytest.approx(1.8)
