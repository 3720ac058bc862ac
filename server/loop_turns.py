"""Work for observers: one piece of it in each turn of the event loop, of whatever kind and for whichever robot.

Pictures for them, datagrams of them and feedback for them come in slices. Had each kind its slice in every turn, then
the operator's messages, which wait for the end of a turn at each step of their way, would wait for all of them.
"""

import asyncio
from collections import deque
from collections.abc import Callable
from weakref import WeakKeyDictionary

__all__ = ["LoopTurns", "turns_of_loop"]


class LoopTurns:
    """First come, first served: whoever has more to do asks again, and comes after all who wait."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_scheduled = False

    def ask(self, work: Callable[[], None]) -> None:
        """Call `work` in one of the next turns of the loop, in none with other work; it should take a slice at most.

        What it raises goes to the loop's handler, and the others have their turns all the same.
        """
        self._waiting.append(work)
        self._schedule()

    def _schedule(self) -> None:
        if self._waiting and not self._is_scheduled:
            self._is_scheduled = True
            asyncio.get_running_loop().call_soon(self._next)

    def _next(self) -> None:
        work = self._waiting.popleft()
        self._is_scheduled = False
        self._schedule()
        work()


_turns: WeakKeyDictionary[asyncio.AbstractEventLoop, LoopTurns] = WeakKeyDictionary()


def turns_of_loop() -> LoopTurns:
    """Those of the running loop: all robots of a console share them, as they share the loop."""
    loop = asyncio.get_running_loop()
    turns = _turns.get(loop)
    if turns is None:
        turns = _turns[loop] = LoopTurns()
    return turns
