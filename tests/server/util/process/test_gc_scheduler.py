import asyncio
import gc
import weakref

import pytest

from lockstep.server.util.process import gc_scheduler
from lockstep.server.util.process.gc_scheduler import ENOUGH, INTERVAL, PATIENCE, SweepPlan, sweep_forever


def test_a_sweep_is_due_when_enough_have_left_and_some_time_has_passed() -> None:
    plan = SweepPlan(0.0)
    assert not plan.due(ENOUGH - 1, False, INTERVAL)
    assert not plan.due(ENOUGH, False, INTERVAL - 0.1)
    assert plan.due(ENOUGH, False, INTERVAL)


def test_it_waits_for_a_robot_that_moves_but_not_for_ever() -> None:
    plan = SweepPlan(0.0)
    assert not plan.due(ENOUGH, True, PATIENCE - 0.1)
    assert plan.due(ENOUGH, True, PATIENCE)


def test_those_that_left_before_a_sweep_count_no_more() -> None:
    plan = SweepPlan(0.0)
    plan.swept(ENOUGH, INTERVAL)
    assert not plan.due(2 * ENOUGH - 1, False, 3 * INTERVAL)
    assert plan.due(2 * ENOUGH, False, 3 * INTERVAL)


class Knot:
    def __init__(self) -> None:
        self.itself = self


async def test_a_sweep_unties_what_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gc_scheduler, "LOOK", 0.01)
    monkeypatch.setattr(gc_scheduler, "INTERVAL", 0.0)
    gone = asyncio.Event()
    loop = asyncio.get_running_loop()
    gc.disable()
    try:
        knot = Knot()
        watch = weakref.ref(knot, lambda _: loop.call_soon(gone.set))
        del knot
        task = asyncio.create_task(sweep_forever(lambda: ENOUGH, lambda: False))
        async with asyncio.timeout(20):
            await gone.wait()
        assert watch() is None
    finally:
        gc.enable()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_memory_goes_back_although_nobody_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gc_scheduler, "LOOK", 0.01)
    given_back = asyncio.Event()
    loop = asyncio.get_running_loop()
    monkeypatch.setattr(gc_scheduler, "give_back", lambda: loop.call_soon_threadsafe(given_back.set))
    task = asyncio.create_task(sweep_forever(lambda: 0, lambda: True))
    try:
        async with asyncio.timeout(20):
            await given_back.wait()
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
