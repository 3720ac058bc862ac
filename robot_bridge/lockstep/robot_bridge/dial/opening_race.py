"""Opens a connection beside one whose opening has met a loss.

Where packets of a handshake are lost, TCP repeats them after ever longer times. Another connection is open sooner.
"""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

__all__ = ["MOST", "late_after", "open_first"]

MOST = 2  # at once; a console that is slow for its many robots must not get many times the work
LATE, LATE_TRIPS = 0.4, 3.0  # s, and round trips: TLS and the WebSocket take two, and the console's own time

Opened = TypeVar("Opened")
OnItsWay = Callable[[float], None]


def late_after(round_trip: float) -> float:
    """Return the seconds after which a handshake is late, on a path of this round trip in s."""
    return max(LATE, LATE_TRIPS * round_trip)


async def open_first(open_one: Callable[[OnItsWay], Awaitable[Opened]], discard: Callable[[Opened], None]) -> Opened:
    """Return the first of several connections that is open; the caller bounds the time.

    Args:
        open_one: opens one. It calls its argument with the seconds after which another is to be begun beside it. An
            error ends the race when no other is on its way; the first error is raised
        discard: closes one that nobody needs, because another was open before
    """
    loop = asyncio.get_running_loop()
    outcomes: asyncio.Queue[Opened | _Failed] = asyncio.Queue()
    timers: list[asyncio.TimerHandle] = []
    opening: list[asyncio.Task[None]] = []

    failures: list[_Failed] = []

    def failed(outcome: _Failed) -> int:
        failures.append(outcome)
        return len(failures)

    async def run() -> None:
        try:
            outcomes.put_nowait(await open_one(on_its_way))
        except Exception as error:
            outcomes.put_nowait(_Failed(error))

    def begin() -> None:
        if len(opening) < MOST and outcomes.empty():
            opening.append(tasks.create_task(run()))

    def on_its_way(seconds: float) -> None:
        timers.append(loop.call_later(seconds, begin))

    try:
        async with asyncio.TaskGroup() as tasks:
            begin()
            try:
                first = await outcomes.get()
                while isinstance(first, _Failed) and failed(first) < len(opening):
                    first = await outcomes.get()
            finally:
                for timer in timers:
                    timer.cancel()
            for task in opening:
                task.cancel()
    finally:
        while not outcomes.empty():  # others were open in the same moment, or nobody waits any more
            other = outcomes.get_nowait()
            if not isinstance(other, _Failed):
                discard(other)
    if isinstance(first, _Failed):
        raise failures[0].error
    return first


class _Failed:
    def __init__(self, error: Exception) -> None:
        self.error = error
