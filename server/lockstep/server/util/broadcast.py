"""Wakes every task that waits, each time that there is news."""

import asyncio

__all__ = ["Broadcast"]


class Broadcast:
    """Unlike an event it stays not set: a task that waits from now on waits for the next call of `send`."""

    def __init__(self) -> None:
        self._next = asyncio.Event()  # replaced each time

    async def wait(self) -> None:
        await self._next.wait()

    def send(self) -> None:
        self._next.set()
        self._next = asyncio.Event()
