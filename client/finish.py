"""Waiting for what has to come to its end."""

import asyncio
from collections.abc import Coroutine
from typing import Any

__all__ = ["finish"]


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
