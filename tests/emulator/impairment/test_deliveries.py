import asyncio
import time

import pytest

from lockstep.emulator.impairment import deliveries as module
from lockstep.emulator.impairment.deliveries import Deliveries


@pytest.fixture(params=["timer descriptor", "loop's timer"])
def clock(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "loop's timer":
        monkeypatch.setattr(module, "_timer_descriptor", lambda: None)


@pytest.mark.usefixtures("clock")
async def test_things_arrive_in_the_order_of_their_times_and_never_early() -> None:
    waiting, done = Deliveries(), asyncio.Event()
    arrived: list[str] = []
    began = time.monotonic()

    def arrive(name: str, due: float) -> None:
        assert time.monotonic() >= due
        arrived.append(name)
        if len(arrived) == 5:
            done.set()

    for name, after in (("late", 0.03), ("early", 0.01), ("same", 0.02), ("as the same", 0.02), ("middle", 0.015)):
        waiting.at(began + after, arrive, name, began + after)
    assert len(waiting) == 5
    async with asyncio.timeout(20):
        await done.wait()
    waiting.close()
    assert arrived == ["early", "middle", "same", "as the same", "late"]


@pytest.mark.usefixtures("clock")
async def test_what_is_due_goes_at_once_unless_something_waits_before_it() -> None:
    waiting, done = Deliveries(), asyncio.Event()
    arrived: list[str] = []
    now = time.monotonic()
    waiting.at(now, arrived.append, "at once")
    assert arrived == ["at once"]
    waiting.at(now + 0.01, arrived.append, "later")
    waiting.at(now + 0.02, done.set)
    async with asyncio.timeout(20):
        await done.wait()
    waiting.close()
    assert arrived == ["at once", "later"]


@pytest.mark.usefixtures("clock")
async def test_a_delivery_may_start_another() -> None:
    waiting, done = Deliveries(), asyncio.Event()
    waiting.at(time.monotonic() + 0.005, lambda: waiting.at(time.monotonic() + 0.005, done.set))
    async with asyncio.timeout(20):
        await done.wait()
    waiting.close()


@pytest.mark.usefixtures("clock")
async def test_nothing_arrives_after_the_end() -> None:
    waiting, other, done = Deliveries(), Deliveries(), asyncio.Event()
    arrived: list[str] = []
    waiting.at(time.monotonic() + 0.01, arrived.append, "never")
    other.at(time.monotonic() + 0.03, done.set)
    waiting.close()
    waiting.at(time.monotonic(), arrived.append, "never")
    async with asyncio.timeout(20):
        await done.wait()
    other.close()
    assert arrived == []
