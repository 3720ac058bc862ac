"""Runs hundreds of observers on this machine that take no time from the measurement."""

import shutil
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

from lockstep.bench.context import Context
from lockstep.bench.harness.processes import Running, running_process

__all__ = ["idle_crowd"]

AT_MOST = 100  # in one process
CONNECT_SECONDS = 150.0
# Real observers have their own machines: these take the time that others leave (sched(7)).
IDLE = ("chrt", "--idle", "0") if shutil.which("chrt") else ("nice", "-n", "19")


@asynccontextmanager
async def idle_crowd(link: str, count: int, context: Context) -> AsyncIterator[list[Running]]:
    """Connect observers, each an audience process that runs when no other process wants to."""
    async with AsyncExitStack() as stack:
        audiences: list[Running] = []
        for size in [min(AT_MOST, count - first) for first in range(0, count, AT_MOST)]:
            command = (*IDLE, sys.executable, "-m", "lockstep.bench.viewers.audience", link, str(size))
            audience, ready = await stack.enter_async_context(running_process(*command, ready_seconds=CONNECT_SECONDS))
            context.say(f"{size} observers connected within {ready['seconds']} s")
            audiences.append(audience)
        yield audiences
