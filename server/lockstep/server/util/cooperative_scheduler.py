"""Schedules work for observers: one slice in each iteration of the event loop, for all kinds of work and all robots.

Pictures for observers, datagrams from them and feedback for them are handled in slices. A slice lasts until something
arrives that must not wait: from an operator, from the robot, or from a thread that has encoded a picture. So slices may
be long, and processor time goes into work rather than into iterating the loop; the driver waits for one piece of work
at most.
"""

import asyncio
import select
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol
from weakref import WeakKeyDictionary, ref

__all__ = ["SLICE", "HasFileno", "CooperativeScheduler", "turns_of_loop"]

SLICE = 0.001  # s; anything unannounced, such as an HTTP request, waits for one at each of its steps


class HasFileno(Protocol):
    """A socket, or an object that stands for one."""

    def fileno(self) -> int: ...


class CooperativeScheduler:
    """Runs work first come, first served: work that has more to do asks again, and comes after all that waits.

    Every method but `call_from_thread` has to be called on the loop's thread.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter, slice_seconds: float = SLICE) -> None:
        """Schedule on the running loop."""
        self._loop = ref(asyncio.get_running_loop())  # weak, or `_turns` would keep the loop alive
        self._clock = clock
        self._slice = slice_seconds
        self._ends_at = 0.0  # s, end of the running slice
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_scheduled = False
        self._busy = 0.0  # s, up to the end of the last busy time
        self._busy_since: float | None = None  # None: no work waits
        self._coming: deque[Callable[[], None]] = deque()  # calls from threads
        self._sockets = select.epoll()

    def ask(self, work: Callable[[], None]) -> None:
        """Call `work` in one of the next iterations of the loop, without other work in the same one.

        It does one piece at least, and leaves the rest to another iteration when `is_over` is True. Its exceptions go
        to the loop's handler, and other work goes on all the same.
        """
        self._waiting.append(work)
        if self._busy_since is None:
            self._busy_since = self._clock()
        self._schedule()

    @property
    def busy_seconds(self) -> float:
        """Total time in which work waited or ran; if it grows as fast as the clock, there is too much work."""
        return self._busy + (0.0 if self._busy_since is None else self._clock() - self._busy_since)

    def is_over(self) -> bool:
        """True if the running slice is over: its time has passed, or something waits that must not."""
        return bool(self._coming) or self._clock() >= self._ends_at or bool(self._sockets.poll(0, 1))

    def yield_to(self, socket: HasFileno) -> None:
        """End slices as soon as this socket is readable. A socket that closes is forgotten automatically."""
        number = socket.fileno()
        if number < 0:  # closed already
            return
        with suppress(FileExistsError):
            self._sockets.register(number, select.EPOLLIN)

    def call_from_thread(self, call: Callable[[], None]) -> None:
        """Have the loop call this, and end the running slice for it. Thread-safe.

        Raises:
            RuntimeError: the loop is closed.
        """
        loop = self._loop()
        if loop is None:
            raise RuntimeError("the event loop is gone")
        self._coming.append(call)
        loop.call_soon_threadsafe(self._come)

    def _come(self) -> None:
        self._coming.popleft()()

    def _schedule(self) -> None:
        if self._waiting and not self._is_scheduled:
            self._is_scheduled = True
            asyncio.get_running_loop().call_soon(self._next)

    def _next(self) -> None:
        work = self._waiting.popleft()
        self._is_scheduled = False
        self._schedule()
        self._ends_at = self._clock() + self._slice
        try:
            work()
        finally:
            if not self._waiting:
                self._busy, self._busy_since = self.busy_seconds, None


_turns: WeakKeyDictionary[asyncio.AbstractEventLoop, CooperativeScheduler] = WeakKeyDictionary()


def turns_of_loop() -> CooperativeScheduler:
    """Return the running loop's scheduler: all robots of a console share it, as they share the loop."""
    loop = asyncio.get_running_loop()
    turns = _turns.get(loop)
    if turns is None:
        turns = _turns[loop] = CooperativeScheduler()
    return turns
