"""What runs beside a block ends with it, and either may fail."""

import asyncio

import pytest

from lockstep.server.util.background_tasks import background_tasks
from tests.waiting import PATIENCE


async def _for_ever(ended: list[str]) -> None:
    try:
        await asyncio.Event().wait()
    finally:
        ended.append("ended")


async def _fail() -> None:
    raise ZeroDivisionError("planted")


async def test_the_work_ends_with_the_block() -> None:
    ended: list[str] = []
    async with background_tasks(_for_ever(ended), _for_ever(ended)):
        await asyncio.sleep(0)
        assert ended == []
    assert ended == ["ended", "ended"]


async def test_an_exception_of_the_block_comes_out_as_it_is_behind_the_end_of_the_work() -> None:
    ended: list[str] = []
    error = KeyError("of the block")

    async def run() -> None:
        async with background_tasks(_for_ever(ended)):
            await asyncio.sleep(0)
            raise error

    with pytest.raises(KeyError) as raised:
        await run()
    assert raised.value is error
    assert ended == ["ended"]


async def test_work_that_fails_cancels_the_block_and_comes_out_as_a_group() -> None:
    ended: list[str] = []

    async def run() -> None:
        async with asyncio.timeout(PATIENCE), background_tasks(_for_ever(ended), _fail()):
            await asyncio.Event().wait()

    with pytest.raises(ExceptionGroup) as raised:
        await run()
    assert [repr(each) for each in raised.value.exceptions] == ["ZeroDivisionError('planted')"]
    assert ended == ["ended"]
    await asyncio.sleep(0)  # and nothing is left of the cancellation


async def test_a_block_that_is_cancelled_ends_the_work_and_stays_cancelled() -> None:
    ended: list[str] = []

    async def run() -> None:
        async with background_tasks(_for_ever(ended)):
            await asyncio.Event().wait()

    async with asyncio.timeout(PATIENCE), asyncio.TaskGroup() as tasks:
        running = tasks.create_task(run())
        await asyncio.sleep(0.01)
        running.cancel()
    assert running.cancelled()
    assert ended == ["ended"]
