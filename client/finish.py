"""Waiting for what has to come to its end."""

import asyncio
from collections.abc import Coroutine, Iterable
from typing import Any

__all__ = ["cancel_all", "finish", "within"]

ASK_AGAIN = 1.0  # s


async def finish(coroutine: Coroutine[Any, Any, None]) -> None:
    """Await it; a cancellation meanwhile takes effect at its end.

    aioice takes a cancellation while it closes a connection for the one that it has asked for itself, and goes on: a
    caller that is cancelled at that moment would never hear of it.
    """
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
    """Cancel them, and wait until all have ended.

    A task may swallow the cancellation: aioice does so, and `asyncio.wait_for` before Python 3.12, when what it waits
    for comes at the same moment. So who goes on is asked again.
    """
    left = set(tasks)
    while left:
        for task in left:
            task.cancel()
        _, left = await asyncio.wait(left, timeout=ASK_AGAIN)


async def within(seconds: float, coroutine: Coroutine[Any, Any, None]) -> None:
    """Await it for at most so long. What hangs longer, as a connection that cannot close, is cancelled and left.

    So it is when the caller is cancelled.
    """
    task = asyncio.ensure_future(coroutine)
    try:
        done, _ = await asyncio.wait({task}, timeout=seconds)
    finally:
        if not task.done():
            task.cancel()
            task.add_done_callback(_look_away)
    if done:
        task.result()


def _look_away(task: asyncio.Task[None]) -> None:
    """What was left may fail yet; nobody waits for it."""
    if not task.cancelled():
        task.exception()
