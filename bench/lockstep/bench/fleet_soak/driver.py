"""Drives one robot all the time as its operator, and reports faults while its own bridge lives."""

import asyncio
import time
from collections import Counter
from typing import NamedTuple

from lockstep.bench.harness.driving import drive_on, round_and_round
from lockstep.client import Console
from lockstep.client.errors import CommandRefused, ConsoleError

__all__ = ["FleetDriver", "Trip"]

AGAIN_SECONDS = 0.2  # s until a driver that was thrown out connects again
STUCK_SECONDS = 10.0  # s without an answer to a command


class Trip(NamedTuple):
    """One command and its feedback."""

    answered: float  # monotonic
    seconds: float


class FleetDriver:
    """Drives one robot. Start `run` as a task, and call `bridge_dies` before its bridge is killed.

    Attributes:
        driving: set while it drives a bridge that lives
        trips: of all its commands
        noticed: counts of the faults while its own bridge lived, by name
        slowest_return: s from a death of its bridge until it drove again
    """

    def __init__(self, name: str, link: str, rate: float, *, pictures: bool) -> None:
        self.name = name
        self.driving = asyncio.Event()
        self.trips: list[Trip] = []
        self.noticed: Counter[str] = Counter()
        self.slowest_return = 0.0
        self._link = link
        self._rate = rate
        self._pictures = pictures
        self._dead_epoch = ""  # epoch of the bridge that was killed
        self._died_at: float | None = None  # None: it lives
        self._epoch = ""

    def bridge_dies(self) -> None:
        self._dead_epoch, self._died_at = self._epoch, time.monotonic()
        self.driving.clear()

    async def run(self) -> None:
        """Drive until cancelled."""
        while True:
            try:
                async with Console(
                    self._link, video=self._pictures, audio=False, decode=False, event_rate=self._rate, name=self.name
                ) as console:
                    await console.take_seat()
                    await self._drive(console)
            except (ConsoleError, TimeoutError) as error:
                self._notice(type(error).__name__)
            await asyncio.sleep(AGAIN_SECONDS)

    def _notice(self, what: str) -> None:
        if self._died_at is None and self._epoch:  # until the first command nothing was lost
            self.noticed[what] += 1

    async def _drive(self, console: Console) -> None:
        values = round_and_round(console.description)
        while True:
            sent = time.monotonic()
            try:
                async with asyncio.timeout(STUCK_SECONDS):
                    await drive_on(console, values(sent))
            except CommandRefused as error:
                self._notice(error.reason)
                await asyncio.sleep(AGAIN_SECONDS)
                if console.seat.holder != console.peer:
                    await console.take_seat()
            else:
                self._answered(console.epoch, sent, time.monotonic())
                await asyncio.sleep(max(0.0, sent + 1 / self._rate - time.monotonic()))

    def _answered(self, epoch: str, sent: float, now: float) -> None:
        if self._died_at is not None:
            if epoch == self._dead_epoch:
                return  # the command on its way when the bridge died
            self.slowest_return = max(self.slowest_return, now - self._died_at)
            self._died_at = None
        else:
            self.trips.append(Trip(now, now - sent))
        self._epoch = epoch
        self.driving.set()
