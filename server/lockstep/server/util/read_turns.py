"""Turns in which many connections are read, within one budget of the thread's time for all of them together."""

import asyncio
import time
from collections.abc import Callable

from lockstep.protocol.pacing.paced_reader import ReadBudget

__all__ = ["ReadTurns"]


class ReadTurns:
    """Lets one reader read in each iteration of the loop while readers wait; each waits for its turn but once.

    A reader that comes while there is time, and nobody waits, reads at once. Readers report what their reading cost.
    """

    def __init__(self, share: float, burst: float, clock: Callable[[], float] = time.monotonic) -> None:
        """`share`: of the thread's time. `burst`: s of it at once."""
        self._clock = clock
        self._budget = ReadBudget(share, burst, clock())
        self._next_at = clock()
        self._waiting: dict[Callable[[], None], None] = {}  # the next first
        self._timer: asyncio.TimerHandle | None = None  # None: nobody waits

    @property
    def is_free(self) -> bool:
        """True if a reader may read at once."""
        return not self._waiting and self._clock() >= self._next_at

    def ask(self, read: Callable[[], None]) -> None:
        """Call `read` in its turn, not before this returns."""
        self._waiting[read] = None
        self._come_back()

    def leave(self, read: Callable[[], None]) -> None:
        """Forget a reader that waits."""
        self._waiting.pop(read, None)

    def spend(self, worked: float) -> None:
        """Account for the seconds of the thread's time that a reader has just taken."""
        now = self._clock()
        self._next_at = now + self._budget.spend(worked, now)

    def _come_back(self) -> None:
        if self._timer is None and self._waiting:
            wait = max(0.0, self._next_at - self._clock())
            self._timer = asyncio.get_running_loop().call_later(wait, self._pass_on)

    def _pass_on(self) -> None:
        self._timer = None
        try:
            if self._waiting and self._clock() >= self._next_at:
                read = next(iter(self._waiting))
                del self._waiting[read]
                read()
        finally:
            self._come_back()
