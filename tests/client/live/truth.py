"""What was true at the bridge, to compare with what a client was given."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from lockstep.client import Console, Picture
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from tests.support.stack import Stack

__all__ = ["collecting", "drawn_event", "executed_after", "logged_stamps", "until_logged"]

LOG_SECONDS = 20.0  # for what follows from what a test did


def drawn_event(picture: Picture) -> int | None:
    """The event that the robot drew into the picture, read from its pixels."""
    frame = picture.frame
    return read_event_strip(frame.to_ndarray(format="gray"))


async def until_logged(stack: Stack, kind: str, condition: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """The first record of this kind that meets the condition, which may come a moment later."""
    async with asyncio.timeout(LOG_SECONDS):
        while True:
            for record in await stack.events(kind):
                if condition(record):
                    return record
            await asyncio.sleep(0.05)


async def logged_stamps(stack: Stack, stream: str, newest: int) -> set[int]:
    """The stamps that the bridge gave this stream; the log is complete up to `newest`."""
    await until_logged(stack, "feedback", lambda record: record["event"] >= newest)
    return {record["event"] for record in await stack.events("media") if record["stream"] == stream}


async def executed_after(stack: Stack, time: float) -> list[dict[str, Any]]:
    return [record for record in await stack.events("executed") if record["time"] > time]


@asynccontextmanager
async def collecting(console: Console, *, sound: bool = True) -> AsyncIterator[dict[str, list[Any]]]:
    """Everything that passes the gate meanwhile, by stream."""
    found: dict[str, list[Any]] = {camera.name: [] for camera in console.description.cameras}
    found |= {microphone.name: [] for microphone in console.description.microphones if sound}

    async def watch(camera: str) -> None:
        async for picture in console.pictures(camera, keep=50):
            found[camera].append(picture)

    async def listen(microphone: str) -> None:
        async for segment in console.sounds(microphone):
            found[microphone].append(segment)

    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(watch(camera.name)) for camera in console.description.cameras]
        tasks += [group.create_task(listen(each.name)) for each in console.description.microphones if sound]
        await asyncio.sleep(0)
        try:
            yield found
        finally:
            for task in tasks:
                task.cancel()
