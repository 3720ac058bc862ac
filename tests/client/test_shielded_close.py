"""What has to come to its end does, and no cancellation is lost."""

import asyncio

import pytest

from lockstep.client import Console
from lockstep.client.shielded_close import cancel_all, finish
from lockstep.client.transport.whep import Whep
from tests.support.stack import Stack


async def test_a_cancellation_meanwhile_takes_effect_at_the_end() -> None:
    go_on = asyncio.Event()
    ended: list[bool] = []

    async def work() -> None:
        await go_on.wait()
        ended.append(True)

    task = asyncio.create_task(finish(work()))
    await asyncio.sleep(0)
    task.cancel()
    await asyncio.sleep(0)
    task.cancel()
    await asyncio.sleep(0)
    assert not task.done()
    go_on.set()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert ended == [True]


async def test_what_it_raises_is_raised() -> None:
    async def fail() -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        await finish(fail())


@pytest.mark.asyncio(loop_scope="module")
async def test_somebody_who_is_cancelled_while_a_connection_closes_ends(
    stack: Stack, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, end = asyncio.Event(), Whep.end

    async def end_cancelled(whep: Whep, resource: str) -> None:
        guest.cancel()
        await asyncio.sleep(0)
        await end(whep, resource)

    monkeypatch.setattr("lockstep.client.transport.whep.Whep.end", end_cancelled)

    async def attend() -> None:
        async with Console(stack.observer, video=1, audio=False):
            pass
        left.set()
        await asyncio.Event().wait()

    guest = asyncio.create_task(attend())
    async with asyncio.timeout(30):
        with pytest.raises(asyncio.CancelledError):
            await guest
    assert not left.is_set()


async def test_who_swallows_a_cancellation_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.client.shielded_close.ASK_AGAIN", 0.01)
    swallowed = asyncio.Event()

    async def stubborn() -> None:
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            swallowed.set()
        await asyncio.Event().wait()

    tasks = [asyncio.create_task(stubborn()), asyncio.create_task(asyncio.sleep(60))]
    await asyncio.sleep(0)
    async with asyncio.timeout(20):
        await cancel_all(tasks)
    assert swallowed.is_set()
    assert all(task.cancelled() for task in tasks)
