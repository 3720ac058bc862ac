"""What must not be cancelled in the middle, because it would leave something open."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, TypeVar

import structlog

__all__ = ["attempt", "in_thread", "to_the_end"]

log = structlog.get_logger(__name__)

DISK_SECONDS = 3.0  # then a disk does not answer, and the end waits for it no longer

Result = TypeVar("Result")


async def attempt(work: Awaitable[Result]) -> Result:
    """Await it, for a loop that goes on after an exception; returns or raises what it does.

    A caller that is cancelled meanwhile gets CancelledError whatever the work raises as it ends, which is logged:
    asyncio cancels only once, and an exception of clean-up would replace that. RuntimeError if the work was cancelled
    and the caller was not. The work has a task of its own, for a TaskGroup (Python 3.11) leaves a cancellation of its
    own counted, which nobody could tell from the caller's.
    """
    caller = asyncio.current_task()
    if caller is None:
        raise RuntimeError("an attempt needs a task")
    before = caller.cancelling()
    task = asyncio.ensure_future(work)
    try:
        return await task
    except asyncio.CancelledError:
        if caller.cancelling() > before:
            raise
        raise RuntimeError("it was cancelled, and its caller was not") from None
    except Exception:
        if caller.cancelling() > before:
            log.exception("failed as it ended")
        raise
    finally:
        if caller.cancelling() > before:
            raise asyncio.CancelledError


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
