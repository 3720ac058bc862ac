"""A fair queue for requests: a salvo of them must not delay the operator's messages."""

import asyncio
from collections import deque
from collections.abc import Callable

from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["FairQueue"]

OTHERS = 2  # pieces of other work between two beginnings, while both wait

Work = Callable[[], None]


class FairQueue:
    """Runs one piece of work in each iteration of the loop; addresses take turns, and each one's work keeps its order.

    Work that is `first` comes before all other work, with turns among its addresses. Other work keeps to the pace, if
    there is one, and every third turn of it goes to a new connection (a beginning). The queue is bounded by the number
    of connections, since each has one request under way.
    """

    def __init__(self, pace: TokenBucket | None = None) -> None:
        """`pace`: the budget of work that is not `first`, by the loop's clock; None: no limit."""
        self._is_free = True  # in this iteration of the loop
        self._pace = pace
        self._first: dict[str, deque[Work]] = {}  # by address, the next first
        self._others: dict[str, deque[Work]] = {}
        self._beginnings: deque[Work] = deque()
        self._since = 0  # pieces of other work done since the last beginning
        self._timer: asyncio.TimerHandle | None = None  # while the pace holds others back

    async def take(self, address: str, *, first: bool = False) -> None:
        """Wait for this request's turn: it comes at once if there was no other in this iteration of the loop."""
        if self._may_begin(first):
            return
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._queue(address, lambda: _settle(turn), first)
        await turn

    async def begin(self) -> None:
        """Wait as `take` does, for a new connection: every third turn is for one, however much other work waits.

        The two turns between are for connections that have begun, so that they are served before newer ones need their
        places.
        """
        if self._may_begin(False):
            return
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._beginnings.append(lambda: _settle(turn))
        self._come_back_soon()
        await turn

    def ask(self, address: str, work: Work, *, first: bool = False) -> None:
        """Call `work` in its turn, possibly before this returns."""
        if self._may_begin(first):
            work()
        else:
            self._queue(address, work, first)

    def _may_begin(self, first: bool) -> bool:
        loop = asyncio.get_running_loop()
        if not self._is_free or not (first or (not self._waits and self._paced(loop.time()))):
            return False
        self._is_free = False
        loop.call_soon(self._pass_on)
        return True

    def _queue(self, address: str, work: Work, first: bool) -> None:
        (self._first if first else self._others).setdefault(address, deque()).append(work)
        self._come_back_soon()

    def _come_back_soon(self) -> None:
        if self._is_free:  # otherwise nothing would call `_pass_on`
            self._is_free = False
            asyncio.get_running_loop().call_soon(self._pass_on)

    def _paced(self, now: float) -> bool:
        return self._pace is None or self._pace.take(now)

    def _pass_on(self) -> None:
        loop = asyncio.get_running_loop()
        if self._first:
            work = _next(self._first)
        elif self._waits and self._paced(loop.time()):
            work = self._next_other()
        else:
            self._is_free = True
            if self._waits and self._timer is None and self._pace is not None:
                self._timer = loop.call_later(self._pace.wait(loop.time()), self._come_back)
            return
        loop.call_soon(self._pass_on)
        work()

    @property
    def _waits(self) -> bool:
        """True if work waits that is not `first`."""
        return bool(self._others or self._beginnings)

    def _next_other(self) -> Work:
        if self._beginnings and (self._since >= OTHERS or not self._others):
            self._since = 0
            return self._beginnings.popleft()
        self._since += 1
        return _next(self._others)

    def _come_back(self) -> None:
        self._timer = None
        if self._is_free:
            self._is_free = False
            self._pass_on()


def _next(queues: dict[str, deque[Work]]) -> Work:
    address = next(iter(queues))
    queue = queues.pop(address)
    work = queue.popleft()
    if queue:
        queues[address] = queue  # behind the others
    return work


def _settle(turn: "asyncio.Future[None]") -> None:
    if not turn.done():  # the waiting task may be gone
        turn.set_result(None)
