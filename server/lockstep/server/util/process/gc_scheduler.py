"""Schedules garbage collection: after peers have left, and preferably while the robot is at rest.

A connection is a reference cycle of a few hundred kilobytes that only Python's collector can free. Its own thresholds
would trigger only after hundreds of connections, and a collection blocks everything, commands included, for some
milliseconds.

Freed memory is returned to the system more often: peers that come and go, and encoders opened for a bad path, leave
holes that glibc keeps, and the process would seem to grow. That takes less than a millisecond, on a thread.
"""

import asyncio
import gc
import itertools
import time
from collections.abc import Callable

from lockstep.server.util.process.glibc_malloc import give_back

__all__ = ["SweepPlan", "sweep_forever"]

ENOUGH = 5  # ended connections that call for a sweep
INTERVAL = 10.0  # s between two sweeps
PATIENCE = 30.0  # s that a sweep waits for a robot that moves all the time
LOOK = 2.0  # s between two looks
GIVE_BACK_LOOKS = 5  # looks between two calls of `give_back`


class SweepPlan:
    """Decides when to sweep: ask `due`, report with `swept`. No I/O."""

    def __init__(self, now: float) -> None:
        self._swept_at = now
        self._swept = 0

    def due(self, ended: int, moving: bool, now: float) -> bool:
        """True if a sweep is due. `ended`: all connections that have ended so far."""
        waited = now - self._swept_at
        return ended - self._swept >= ENOUGH and waited >= (PATIENCE if moving else INTERVAL)

    def swept(self, ended: int, now: float) -> None:
        self._swept_at, self._swept = now, ended


async def sweep_forever(ended: Callable[[], int], moving: Callable[[], bool]) -> None:
    """Sweep whenever it is due, until cancelled."""
    plan = SweepPlan(time.monotonic())
    for look in itertools.count(1):
        await asyncio.sleep(LOOK)
        now, count = time.monotonic(), ended()
        swept = plan.due(count, moving(), now)
        if swept:
            gc.collect()
            plan.swept(count, now)
        if swept or look % GIVE_BACK_LOOKS == 0:
            await asyncio.to_thread(give_back)
