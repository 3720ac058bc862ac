"""Pictures with a number drawn into them, whose stamps are held against what the bridge says of each event."""

import asyncio
from bisect import bisect_right
from collections.abc import Mapping
from typing import NamedTuple

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from tests.client.live.truth import until_logged
from tests.support.stack import Stack

__all__ = ["OF_USE", "Shown", "events_behind", "shown_while_driving"]


OF_USE = 25  # events that a stamp may be behind: a second, since a busy machine also encodes late


class Shown(NamedTuple):
    """A picture that the client has shown."""

    number: int  # drawn into it
    stamp: int | None


async def shown_while_driving(console: Console, stream: str, count: int, seconds: float) -> tuple[list[Shown], int]:
    """The first `count` pictures of the stream, and the newest event. Raises TimeoutError after `seconds`."""
    shown: list[Shown] = []

    async def watch() -> None:
        async for picture in console.pictures(stream, keep=50):
            number = read_event_strip(picture.frame.to_ndarray(format="gray"))
            if number is not None:
                shown.append(Shown(number, picture.stamp))

    watching = asyncio.create_task(watch())
    try:
        async with asyncio.timeout(seconds):
            while len(shown) < count:
                feedback = await drive_on(console, {"base.wz": 0.2})
    finally:
        watching.cancel()
    return shown, feedback.event


async def events_behind(stack: Stack, shown: list[Shown], newest: int, captured: Mapping[int, float]) -> list[int]:
    """How many events each stamp is behind the one that held when the picture was captured: never fewer than none.

    `captured`: when, by number, on this machine's clock.
    """
    await until_logged(stack, "feedback", lambda record: record["event"] >= newest)
    times, events = await _truth(stack)
    assert len({stamp for _, stamp in shown}) > 5
    behind = []
    for number, stamp in shown:
        assert stamp is not None
        held = events[bisect_right(times, captured[number]) - 1]
        assert stamp <= held, f"picture {number} says {stamp}, and {held} held"
        behind.append(held - stamp)
    return behind


async def _truth(stack: Stack) -> tuple[list[float], list[int]]:
    """When each event began to hold, by the bridge's own log; its clock is this machine's."""
    first: dict[int, float] = {}
    for record in await stack.events("feedback"):
        first.setdefault(record["event"], record["time"])
    return list(first.values()), list(first)
