"""What must not be cancelled in the middle, because it would leave something open."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

__all__ = ["in_thread", "pause", "to_the_end"]

DISK_SECONDS = 3.0  # then a disk does not answer, and the end waits for it no longer

Result = TypeVar("Result")


async def pause(seconds: float) -> None:
    """Sleep, in a loop that tries again after an exception.

    Raises CancelledError at once in a task that was cancelled before: asyncio raises that only once, and an exception
    of clean-up may have replaced it.
    """
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError
    await asyncio.sleep(seconds)


async def to_the_end(coroutine: Coroutine[Any, Any, object]) -> None:
    """Await it. A caller that is cancelled meanwhile, as by a timeout, is cancelled when it has ended."""
    task = asyncio.ensure_future(coroutine)
    try:
        await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task])
        if not task.cancelled():
            task.exception()  # nobody asks for it any more
        raise


async def in_thread(work: Callable[[], Result]) -> Result:
    """Do `work`, which waits for the disk, in a thread; returns or raises what it does.

    A caller that is cancelled meanwhile ends when the thread has, so that nothing is written after its end; it waits
    for a disk that does not answer for `DISK_SECONDS` at most.
    """
    task = asyncio.ensure_future(asyncio.to_thread(work))
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task], timeout=DISK_SECONDS)
        if task.done() and not task.cancelled():
            task.exception()  # nobody asks for it any more
        raise
