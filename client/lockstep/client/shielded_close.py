"""Waits for the end of tasks and awaitables."""

import asyncio
from collections.abc import Coroutine, Iterable
from typing import Any

__all__ = ["cancel_all", "finish"]

ASK_AGAIN = 1.0  # s


async def finish(coroutine: Coroutine[Any, Any, None]) -> None:
    """Await a coroutine; a cancellation meanwhile takes effect at its end. A coroutine that closes several things, one
    after the other, would leave the others open if it were cancelled itself."""
    task = asyncio.ensure_future(coroutine)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.wait({task})
        except asyncio.CancelledError as error:
            cancelled = error
    if cancelled is not None:
        if not task.cancelled():
            task.exception()  # the cancellation matters more
        raise cancelled
    task.result()


async def cancel_all(tasks: Iterable[asyncio.Task[None]]) -> None:
    """Cancel tasks, and wait until all have ended.

    A task may swallow the cancellation: `asyncio.wait_for` before Python 3.12 does so when its result arrives at the
    same moment. So a task that goes on is cancelled again.
    """
    left = set(tasks)
    while left:
        for task in left:
            task.cancel()
        _, left = await asyncio.wait(left, timeout=ASK_AGAIN)
