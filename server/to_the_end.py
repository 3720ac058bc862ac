"""What must not be cancelled in the middle, because it would leave something open."""

import asyncio
from collections.abc import Coroutine
from typing import Any

__all__ = ["to_the_end"]


async def to_the_end(coroutine: Coroutine[Any, Any, object]) -> None:
    """Await it. Whoever is cancelled meanwhile, as by a timeout, is cancelled when it has ended.

    aioice that is cancelled while it gathers forgets the sockets that it has opened until then.
    """
    task = asyncio.ensure_future(coroutine)
    try:
        await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task])
        if not task.cancelled():
            task.exception()  # nobody asks for it any more
        raise
