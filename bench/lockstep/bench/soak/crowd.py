"""Observers that come and go, and intruders that command without the seat. All are headless, in this process."""

import asyncio
import random
from contextlib import suppress
from functools import partial

from lockstep.bench.harness.driving import axis_values
from lockstep.client import Console
from lockstep.client.errors import CommandRefused, ConsoleError

__all__ = ["Crowd", "Intruder"]

AGAIN_SECONDS = 1.0  # s until an observer that was thrown out tries again
BETWEEN_TRIES = 0.2  # s between two commands of an intruder
BACKWARDS = -0.5  # value of the first axis with which only intruders drive


class Crowd:
    """Keeps `size` observers connected, some leaving and others coming, from `fill` to `close`.

    They are tasks of the group that it is given when they join.
    """

    def __init__(self, link: str, size: int, seed: int) -> None:
        self.joined = self.lost = 0
        self._link = link
        self._size = size
        self._chance = random.Random(seed)
        self._guests: list[asyncio.Task[None]] = []

    def __len__(self) -> int:
        return len(self._guests)

    def fill(self, tasks: asyncio.TaskGroup) -> None:
        """Connect them."""
        while len(self._guests) < self._size:
            self._join(tasks)

    def come(self, tasks: asyncio.TaskGroup) -> None:
        """Let a few observers join, up to the size."""
        for _ in range(min(self._size - len(self._guests), self._chance.randint(1, 5))):
            self._join(tasks)

    async def go(self) -> None:
        """Let a few observers leave, like a person who closes the tab."""
        for _ in range(min(len(self._guests), self._chance.randint(1, 5))):
            guest = self._guests.pop(self._chance.randrange(len(self._guests)))
            await _ended(guest)

    async def close(self) -> None:
        while self._guests:
            await _ended(self._guests.pop())

    def _join(self, tasks: asyncio.TaskGroup) -> None:
        self._guests.append(tasks.create_task(self._attend()))

    async def _attend(self) -> None:
        while True:
            try:
                async with Console(self._link, decode=False, name="guest") as console:
                    self.joined += 1
                    async for _ in console.feedbacks():
                        pass
            except ConsoleError:
                self.lost += 1
            await asyncio.sleep(AGAIN_SECONDS)


class Intruder:
    """A client that sends commands without ever asking for the seat."""

    def __init__(self, link: str, name: str) -> None:
        self.tries = 0
        self._link = link
        self._name = name

    async def run(self) -> None:
        """Intrude until cancelled."""
        while True:
            with suppress(ConsoleError):
                async with Console(self._link, decode=False, name=self._name) as console:
                    await self._intrude(console)
            await asyncio.sleep(AGAIN_SECONDS)

    async def _intrude(self, console: Console) -> None:
        values = axis_values(console.description.axes, {0: BACKWARDS})
        while True:
            self.tries += 1
            # A command that moves is not even sent while the robot asks for a neutral one first.
            for attempt in (console.arm, partial(console.drive, values)):
                with suppress(CommandRefused, TimeoutError):
                    async with asyncio.timeout(1.0):
                        await attempt()
            await asyncio.sleep(BETWEEN_TRIES)


async def _ended(task: asyncio.Task[None]) -> None:
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task
