"""Hundreds of observers on this machine who take no time from what is measured."""

import shutil
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

from bench.context import Context
from bench.processes import Running, running_process

__all__ = ["idle_crowd"]

AT_MOST = 100  # in one process
CONNECT_SECONDS = 150.0
# Real ones have machines of their own: these take what the others leave (sched(7)).
IDLE = ("chrt", "--idle", "0") if shutil.which("chrt") else ("nice", "-n", "19")


@asynccontextmanager
async def idle_crowd(link: str, count: int, context: Context) -> AsyncIterator[list[Running]]:
    """`count` observers (`bench/audience.py`), in processes that run when nobody else wants to."""
    async with AsyncExitStack() as stack:
        audiences: list[Running] = []
        for size in [min(AT_MOST, count - first) for first in range(0, count, AT_MOST)]:
            command = (*IDLE, sys.executable, "-m", "bench.audience", link, str(size))
            audience, ready = await stack.enter_async_context(running_process(*command, ready_seconds=CONNECT_SECONDS))
            context.say(f"{size} observers connected within {ready['seconds']} s")
            audiences.append(audience)
        yield audiences
