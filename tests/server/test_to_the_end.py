"""What must not be cancelled in the middle."""

import asyncio
import threading
from contextlib import suppress

import pytest

from server import to_the_end
from server.to_the_end import in_thread, pause


async def test_whoever_is_cancelled_while_a_thread_writes_ends_when_that_has_ended() -> None:
    began, may_end = asyncio.Event(), threading.Event()
    loop = asyncio.get_running_loop()
    wrote = []

    def work() -> None:
        loop.call_soon_threadsafe(began.set)
        may_end.wait(20)
        wrote.append("all of it")

    writing = asyncio.create_task(in_thread(work))
    await began.wait()
    writing.cancel()
    await asyncio.sleep(0)  # it is cancelled now
    assert not writing.done()
    may_end.set()
    with pytest.raises(asyncio.CancelledError):
        await writing
    assert wrote == ["all of it"]


async def test_a_disk_that_does_not_answer_holds_an_end_up_for_a_bounded_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(to_the_end, "DISK_SECONDS", 0.05)
    began, may_end = asyncio.Event(), threading.Event()
    loop = asyncio.get_running_loop()

    def hang() -> None:
        loop.call_soon_threadsafe(began.set)
        may_end.wait(20)

    writing = asyncio.create_task(in_thread(hang))
    await began.wait()
    writing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await writing
    may_end.set()


async def test_what_a_thread_returns_or_raises_is_told() -> None:
    assert await in_thread(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        await in_thread(lambda: 1 // 0)


async def test_a_loop_whose_cancellation_was_replaced_by_a_fault_of_clean_up_ends_at_its_next_pause() -> None:
    tries = 0

    async def work() -> None:
        nonlocal tries
        tries += 1
        try:
            await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            if tries > 1:
                raise
            raise RuntimeError("clean-up failed") from None

    async def run_on() -> None:
        while True:
            with suppress(RuntimeError):
                await work()
            await pause(0.0)

    running = asyncio.create_task(run_on())
    await asyncio.sleep(0)
    running.cancel()
    for _ in range(5):
        await asyncio.sleep(0)
    ended = running.cancelled()
    running.cancel()
    await asyncio.wait([running])
    assert ended
    assert tries == 1


async def test_a_pause_of_a_task_that_goes_on_is_a_sleep() -> None:
    loop = asyncio.get_running_loop()
    began = loop.time()
    await pause(0.01)
    assert loop.time() - began >= 0.009
