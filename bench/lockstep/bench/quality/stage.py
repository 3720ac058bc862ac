"""Runs robot, console, network and a driving client for one measurement."""

import asyncio
import time
from contextlib import suppress
from dataclasses import dataclass

from lockstep.bench.harness.driving import drive_on, round_and_round
from lockstep.bench.harness.stack import Stack
from lockstep.client import Console, ConsoleLost
from lockstep.emulator import NetworkProcess, Profile
from lockstep.protocol.serial import event_gap

__all__ = ["Drive", "Picture", "Sight", "driving"]

SAMPLE = 0.05  # s between two looks at the screen and the queue


@dataclass(frozen=True)
class Picture:
    """A picture that arrived at the client and was decoded."""

    at: float  # s since the drive began
    stamp: int
    gap: int  # events
    width: int


@dataclass(frozen=True)
class Sight:
    """A sample of the operator's view and of the queue."""

    at: float  # s since the drive began
    gap: int | None  # of the newest picture within tolerance; None before the first
    queue: float  # s that a packet towards the operator waits in the network


class Drive:
    """The record of one drive."""

    def __init__(self, tolerance: int) -> None:
        self.tolerance = tolerance
        self.began = time.monotonic()
        self.pictures: list[Picture] = []
        self.sights: list[Sight] = []
        self.delays: list[tuple[float, float]] = []  # since began, from command to the first picture, s
        self.events = 0
        self.lost_at: float | None = None  # s since the drive began, when the console gave the operator up
        self._sent: list[tuple[int, float]] = []
        self._shown: int | None = None

    def sent(self, event: int, at: float) -> None:
        self._sent.append((event, at))

    def arrived(self, stamp: int, event: int, width: int) -> None:
        """Record a picture that came while the newest feedback was of `event`."""
        now = time.monotonic()
        gap = event_gap(event, stamp)
        self.pictures.append(Picture(now - self.began, stamp, gap, width))
        if abs(gap) <= self.tolerance:
            self._shown = stamp
        while self._sent and event_gap(stamp, self._sent[0][0]) >= 0:
            self.delays.append((now - self.began, now - self._sent.pop(0)[1]))

    def look(self, event: int, queue: float) -> None:
        gap = None if self._shown is None else event_gap(event, self._shown)
        self.sights.append(Sight(time.monotonic() - self.began, gap, queue))


async def driving(
    stack: Stack, profile: Profile, *, seconds: float, tolerance: int, seed: int, codec: str | None = None
) -> Drive:
    """Drive in circles, as fast as events come, and record all pictures that arrive."""
    async with (
        NetworkProcess(profile, console_url=stack.url, seed=seed) as network,
        Console(
            network.link(stack.operator),
            gate="off",  # every picture that arrives is counted; the tolerance is judged here
            tolerance=tolerance,
            name="bench",
            codec=codec,
            connect_seconds=30,
        ) as console,
        asyncio.TaskGroup() as tasks,
    ):
        await console.take_seat()
        network.begin()
        drive = Drive(tolerance)
        helpers = [tasks.create_task(_watch(console, drive)), tasks.create_task(_look(console, network, drive))]
        values = round_and_round(console.description)
        first = console.feedback.event if console.feedback is not None else 0
        try:
            async with asyncio.timeout(seconds):
                while True:
                    began = time.monotonic()
                    feedback = await drive_on(console, values(began))
                    drive.sent(feedback.event, began)
        except TimeoutError:
            pass
        except ConsoleLost:  # a network that is too full for acknowledgements ends the drive
            drive.lost_at = time.monotonic() - drive.began
        drive.events = (console.feedback.event if console.feedback is not None else 0) - first
        for helper in helpers:
            helper.cancel()
    return drive


async def _watch(console: Console, drive: Drive) -> None:
    with suppress(ConsoleLost):  # the drive records it
        async for picture in console.pictures(keep=30):
            if picture.stamp is not None and console.feedback is not None:
                drive.arrived(picture.stamp, console.feedback.event, picture.frame.width)


async def _look(console: Console, network: NetworkProcess, drive: Drive) -> None:
    while True:
        await asyncio.sleep(SAMPLE)
        queue = network.statistics().queues.get("to_operator")
        if console.feedback is not None:
            drive.look(console.feedback.event, 0.0 if queue is None else queue.now)
