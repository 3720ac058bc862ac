"""Keeps a background task running: a fault in one place must not take control or STOP with it."""

import asyncio
from collections.abc import Awaitable, Callable

from lockstep.server.telemetry.faults import Faults
from lockstep.server.util.uncancelled import attempt

__all__ = ["keep_running"]

RESTART_AFTER = 1.0  # s until a background task that failed runs again


async def keep_running(name: str, run: Callable[[], Awaitable[None]], faults: Faults) -> None:
    """Run a task until it is done or cancelled, and again after a fault, which is counted under `name`."""
    while True:
        try:
            await attempt(run())
        except Exception as error:
            faults.caught(name, error, what="a background task, which runs again")
            await asyncio.sleep(RESTART_AFTER)
        else:
            return
