import asyncio

import pytest

from lockstep.bench.harness.background import background


class Work:
    """Goes on until it is cancelled or told to fail."""

    def __init__(self) -> None:
        self.began = asyncio.Event()
        self.fails = asyncio.Event()
        self.ended = False

    async def run(self) -> None:
        self.began.set()
        try:
            await self.fails.wait()
        finally:
            self.ended = True
        raise ZeroDivisionError("planted")


async def test_work_goes_on_during_the_block_and_has_ended_after_it() -> None:
    work, more = Work(), Work()
    async with background(work.run(), more.run()):
        await work.began.wait()
        assert not work.ended
    assert (work.ended, more.ended) == (True, True)


async def test_an_error_of_the_block_is_raised_as_it_is() -> None:
    work = Work()
    error = KeyError("of the block")

    async def block() -> None:
        async with background(work.run()):
            await work.began.wait()
            raise error

    with pytest.raises(KeyError) as raised:
        await block()
    assert raised.value is error
    assert work.ended


async def test_work_that_fails_ends_the_block_and_says_why() -> None:
    work, more = Work(), Work()

    async def block() -> None:
        async with background(work.run(), more.run()):
            work.fails.set()
            await asyncio.Event().wait()

    with pytest.raises(ZeroDivisionError, match="planted"):
        await block()
    assert more.ended
    await asyncio.sleep(0)  # and nothing is left of the cancellation


async def test_a_cancelled_block_stays_cancelled() -> None:
    work = Work()

    async def block() -> None:
        async with background(work.run()):
            await asyncio.Event().wait()

    async with asyncio.TaskGroup() as tasks:
        task = tasks.create_task(block())
        await work.began.wait()
        task.cancel()
    assert task.cancelled()
    assert work.ended
