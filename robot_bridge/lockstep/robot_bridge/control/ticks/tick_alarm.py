"""Lets a command wake the tick loop before the next beat."""

import asyncio

__all__ = ["TickAlarm"]


class TickAlarm:
    """A wait with an end that anything on the loop may bring forward. One waiter at a time."""

    def __init__(self) -> None:
        self._rung = False
        self._waiting: asyncio.Future[None] | None = None  # None while nothing waits, or nothing may end the wait

    def ring(self) -> None:
        """End the wait now, or the next one as soon as it may end. Rings before that count as one."""
        self._rung = True
        self._end_wait()

    async def wait(self, seconds: float, *, at_least: float) -> None:
        """Wait for `seconds`, or until the alarm rings, but at least `at_least` seconds."""
        if at_least > 0:
            await asyncio.sleep(at_least)
        left = seconds - max(0.0, at_least)
        if self._rung or left <= 0:
            if not at_least > 0:
                await asyncio.sleep(0)  # a turn of the loop: what else has arrived comes before the tick
        else:
            await self._until_rung(left)
        self._rung = False

    async def pause(self, seconds: float) -> bool:
        """Wait for `seconds`, or until the alarm rings. Return whether they passed; a ring ends the next wait too."""
        if not self._rung:
            await self._until_rung(seconds)
        return not self._rung

    async def _until_rung(self, seconds: float) -> None:
        loop = asyncio.get_running_loop()
        self._waiting = loop.create_future()
        timer = loop.call_later(seconds, self._end_wait)
        try:
            await self._waiting
        finally:
            timer.cancel()
            self._waiting = None

    def _end_wait(self) -> None:
        if self._waiting is not None and not self._waiting.done():
            self._waiting.set_result(None)
