"""Runs work that must not be cancelled in the middle, because it would leave something open."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any, TypeVar

import structlog

__all__ = ["attempt", "in_thread", "to_the_end"]

log = structlog.get_logger(__name__)

DISK_SECONDS = 3.0  # the longest that a cancelled caller waits for the disk

Result = TypeVar("Result")


async def attempt(work: Awaitable[Result]) -> Result:
    """Await `work`, in a loop that goes on after an exception; return or raise what it does.

    A caller that is cancelled meanwhile gets CancelledError whatever the work raises as it ends, which is logged:
    asyncio cancels only once, and an exception during clean-up would replace the cancellation. Raises RuntimeError if
    the work was cancelled and the caller was not. The work runs in a separate task, because a TaskGroup (Python 3.11)
    leaves its own cancellation counted, which could not be told from the caller's.
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
        raise RuntimeError("the work was cancelled, but its caller was not") from None
    except Exception:
        if caller.cancelling() > before:
            log.exception("the work failed while its caller was cancelled")
        raise
    finally:
        if caller.cancelling() > before:
            raise asyncio.CancelledError


async def to_the_end(coroutine: Coroutine[Any, Any, object]) -> None:
    """Await `coroutine`. A caller that is cancelled meanwhile, as by a timeout, is cancelled after it has ended."""
    task = asyncio.ensure_future(coroutine)
    try:
        await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task])
        if not task.cancelled():
            task.exception()  # marks it as retrieved
        raise


async def in_thread(work: Callable[[], Result]) -> Result:
    """Run `work`, which waits for the disk, in a thread; return or raise what it does.

    A caller that is cancelled meanwhile ends after the thread, so that nothing is written after the caller's end; it
    waits at most `DISK_SECONDS` for a disk that does not answer.
    """
    task = asyncio.ensure_future(asyncio.to_thread(work))
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task], timeout=DISK_SECONDS)
        if task.done() and not task.cancelled():
            task.exception()  # marks it as retrieved
        raise
