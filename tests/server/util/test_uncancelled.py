"""What must not be cancelled in the middle."""

import asyncio
import threading
from contextlib import suppress

import pytest

from lockstep.server.util import uncancelled
from lockstep.server.util.uncancelled import attempt, in_thread


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
    monkeypatch.setattr(uncancelled, "DISK_SECONDS", 0.05)
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


async def test_a_loop_whose_cancellation_was_replaced_by_a_fault_of_clean_up_ends_all_the_same() -> None:
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
                await attempt(work())
            await asyncio.sleep(0)

    running = asyncio.create_task(run_on())
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    running.cancel()
    for _ in range(5):
        await asyncio.sleep(0)
    ended = running.cancelled()
    running.cancel()
    await asyncio.wait([running])
    assert ended
    assert tries == 1


async def test_a_loop_goes_on_after_one_of_several_tasks_of_its_work_failed() -> None:
    tries = 0

    async def fail() -> None:
        await asyncio.sleep(0)
        raise ConnectionError("lost")

    async def work() -> None:
        nonlocal tries
        tries += 1
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(fail())
            tasks.create_task(asyncio.Event().wait())

    for _ in range(3):
        with pytest.raises(ExceptionGroup):
            await attempt(work())
    assert tries == 3
    running = asyncio.current_task()
    assert running is not None
    assert running.cancelling() == 0


async def test_work_that_was_cancelled_by_itself_is_a_fault_and_not_the_end_of_its_caller() -> None:
    async def work() -> None:
        raise asyncio.CancelledError

    with pytest.raises(RuntimeError, match="its caller was not"):
        await attempt(work())


async def test_an_attempt_returns_or_raises_what_its_work_does() -> None:
    async def seven() -> int:
        return 7

    async def fail() -> None:
        raise ZeroDivisionError

    assert await attempt(seven()) == 7
    with pytest.raises(ZeroDivisionError):
        await attempt(fail())
