"""What must not be cancelled in the middle, because it would leave something open."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

__all__ = ["ending", "in_thread", "to_the_end"]

DISK_SECONDS = 3.0  # then a disk does not answer, and the end waits for it no longer

Result = TypeVar("Result")


def ending() -> bool:
    """Whether the running task has been cancelled.

    A loop that goes on after any exception asks: an exception that clean-up raises replaces the cancellation, which is
    told only once.
    """
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


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
