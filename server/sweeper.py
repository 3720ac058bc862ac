"""When to look for garbage: after people have left, and better while the robot is at rest.

A connection is a knot of objects that refer to each other, a few hundred kilobytes that only Python's collector unties.
By itself it would come after hundreds of them; it holds everything up for some milliseconds, a command included.
"""

import asyncio
import ctypes
import gc
import time
from collections.abc import Callable

__all__ = ["SweepPlan", "sweep", "sweep_forever"]

ENOUGH = 5  # connections that have ended
INTERVAL = 10.0  # s between two sweeps
PATIENCE = 30.0  # s that a sweep waits for a robot that moves all the time
LOOK = 2.0  # s


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


def sweep() -> None:
    """Untie what has ended, and give the memory back: glibc keeps what lies between blocks still in use."""
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's own
    if trim is not None:
        trim(0)


async def sweep_forever(ended: Callable[[], int], moving: Callable[[], bool]) -> None:
    """Until cancelled."""
    plan = SweepPlan(time.monotonic())
    while True:
        await asyncio.sleep(LOOK)
        now, count = time.monotonic(), ended()
        if plan.due(count, moving(), now):
            sweep()
            plan.swept(count, now)
