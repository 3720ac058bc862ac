"""When to look for garbage: after people have left, and better while the robot is at rest.

A connection is a knot of objects that refer to each other, a few hundred kilobytes that only Python's collector unties.
By itself it would come after hundreds of them; it holds everything up for some milliseconds, a command included.

What was freed goes back to the system more often: people who come and go, and encoders that open for a bad path, leave
holes that glibc keeps, and the process would seem to grow. That takes less than a millisecond, on a thread.
"""

import asyncio
import gc
import itertools
import time
from collections.abc import Callable

from lockstep.server.util.glibc_malloc import give_back

__all__ = ["SweepPlan", "sweep_forever"]

ENOUGH = 5  # connections that have ended
INTERVAL = 10.0  # s between two sweeps
PATIENCE = 30.0  # s that a sweep waits for a robot that moves all the time
LOOK = 2.0  # s
GIVE_BACK_LOOKS = 5  # looks between two times that memory is given back


class SweepPlan:
    """Ask `due`; tell `swept`. No I/O."""

    def __init__(self, now: float) -> None:
        self._swept_at = now
        self._swept = 0

    def due(self, ended: int, moving: bool, now: float) -> bool:
        """`ended`: connections so far, ever."""
        waited = now - self._swept_at
        return ended - self._swept >= ENOUGH and waited >= (PATIENCE if moving else INTERVAL)

    def swept(self, ended: int, now: float) -> None:
        self._swept_at, self._swept = now, ended


async def sweep_forever(ended: Callable[[], int], moving: Callable[[], bool]) -> None:
    """Until cancelled."""
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
