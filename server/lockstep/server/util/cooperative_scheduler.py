"""Work for observers: one slice of it in each turn of the event loop, of whatever kind and for whichever robot.

Pictures for them, datagrams of them and feedback for them come in slices. A slice lasts until something comes that must
not wait: from an operator, from the robot, or from a thread that has encoded a picture. So slices may be long, and the
processor's time goes into them and not into turning the loop; whoever drives waits for one piece of work at most.
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

SLICE = 0.001  # s; what is not announced, a request by HTTP say, waits for one at each step of its way


class HasFileno(Protocol):
    """A socket, or what stands for one."""

    def fileno(self) -> int: ...


class CooperativeScheduler:
    """First come, first served: whoever has more to do asks again, and comes after all who wait.

    Everything but `call_from_thread` is for the thread of the loop.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter, slice_seconds: float = SLICE) -> None:
        """Of the running loop."""
        self._loop = ref(asyncio.get_running_loop())  # which would not end while its own value holds it
        self._clock = clock
        self._slice = slice_seconds
        self._ends_at = 0.0  # s, the running slice
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_scheduled = False
        self._busy = 0.0  # s, until it last began or ended
        self._busy_since: float | None = None  # None: nobody asks
        self._coming: deque[Callable[[], None]] = deque()  # from threads
        self._sockets = select.epoll()

    def ask(self, work: Callable[[], None]) -> None:
        """Call `work` in one of the next turns of the loop, in none with other work.

        It does one piece at least, and leaves the rest to another turn when `is_over` says so. What it raises goes to
        the loop's handler, and the others have their turns all the same.
        """
        self._waiting.append(work)
        if self._busy_since is None:
            self._busy_since = self._clock()
        self._schedule()

    @property
    def busy_seconds(self) -> float:
        """The time so far in which work waited or was done; when that is all of it, there is more than can be done."""
        return self._busy + (0.0 if self._busy_since is None else self._clock() - self._busy_since)

    def is_over(self) -> bool:
        """Whether the running slice is: its time has passed, or somebody waits who must not."""
        return bool(self._coming) or self._clock() >= self._ends_at or bool(self._sockets.poll(0, 1))

    def yield_to(self, socket: HasFileno) -> None:
        """End slices as soon as there is something to read here. A socket that closes is forgotten by itself."""
        number = socket.fileno()
        if number < 0:  # closed already
            return
        with suppress(FileExistsError):
            self._sockets.register(number, select.EPOLLIN)

    def call_from_thread(self, call: Callable[[], None]) -> None:
        """Have the loop call this, and end the running slice for it. For any thread.

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
    """Those of the running loop: all robots of a console share them, as they share the loop."""
    loop = asyncio.get_running_loop()
    turns = _turns.get(loop)
    if turns is None:
        turns = _turns[loop] = CooperativeScheduler()
    return turns
