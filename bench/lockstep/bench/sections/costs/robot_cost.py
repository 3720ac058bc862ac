"""Measures the default robot's cost of one core: simulation, cameras and sound in its bridge, encoding in the console.

Processor time is the kernel's count for each thread. Encoding is the time of the console's stream threads: decoding,
scaling, encoding and packetising of pictures and of sound. The bridge's share includes its sound and the robot link,
which run in the same thread as the simulation. The rest of the console (WebRTC, fan-out, feedback, HTTP) is a separate
row, and is not part of the figure with the target. An operator drives and receives everything, at full size and rate:
the quality controller is off. As the page does, the operator offers H.264 first. The operator's own process is not
counted. The bridge writes no event log, as by default.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Collection
from contextlib import asynccontextmanager
from typing import NamedTuple

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.harness.driving import console_trips
from lockstep.bench.harness.stack import DEFAULT_ROBOT, Stack, running_stack
from lockstep.client import Console

__all__ = ["run"]

SECTION = "robot_cost"
HELD = "simulation, camera and encoding together"
SECONDS, QUICK_SECONDS = 25, 3
WARM_UP = 2.0  # s
EVENTS = 1_000_000  # more than fit into the time
TARGET = 60.0  # % of one core
RATE_TARGET = 29.0  # pictures a second of 30
THREAD_NAME = 15  # bytes that Linux keeps of a name (prctl(2), PR_SET_NAME)


class Cost(NamedTuple):
    """The costs in one spell."""

    drawing: float  # % of one core: the bridge's render thread
    bridge: float  # the rest of the bridge: simulation, sound, the robot link
    pictures: float  # the console's cameras
    sound: float  # its microphones
    console: float  # the rest of the console
    rate: float  # pictures of the main camera per second
    events: float  # per second


async def run(context: Context) -> list[Result]:
    if DEFAULT_ROBOT not in context.robots:
        missing = f"{DEFAULT_ROBOT} does not start here"
        return [Result(section=SECTION, name=HELD, value=None, unit="%", target=TARGET, conditions=missing)]
    seconds = float(context.scale(SECONDS, QUICK_SECONDS))
    async with (
        running_stack(DEFAULT_ROBOT, is_logged=False, LOCKSTEP_MEDIA__QUALITY="false") as stack,
        _driven(stack) as console,
    ):
        cost = await _spell(stack, console, seconds)
    return _results(cost, console.description.cameras[0].label, seconds)


@asynccontextmanager
async def _driven(stack: Stack) -> AsyncIterator[Console]:
    """Start an operator who drives all the time and receives everything, decoding nothing."""
    async with (
        Console(stack.operator, name="operator", decode=False, codec="H264") as console,
        asyncio.TaskGroup() as tasks,
    ):
        await console.take_seat()
        driving = tasks.create_task(console_trips(console, EVENTS, seconds=1e6))
        await asyncio.sleep(WARM_UP)
        yield console
        driving.cancel()


async def _spell(stack: Stack, console: Console, seconds: float) -> Cost:
    microphones = {microphone.name for microphone in console.description.microphones}
    camera = console.description.cameras[0].name
    event, pictures = _event(console), await _pictures(stack, camera)
    began, before = time.monotonic(), _spent(stack, microphones)
    await asyncio.sleep(seconds)
    ended, after = time.monotonic(), _spent(stack, microphones)
    events, pictures = _event(console) - event, await _pictures(stack, camera) - pictures
    drawing, bridge, encoding, sound, server = (
        100 * (late - early) / (ended - began) for early, late in zip(before, after, strict=True)
    )
    return Cost(drawing, bridge, encoding, sound, server, pictures / (ended - began), events / (ended - began))


def _event(console: Console) -> int:
    feedback = console.feedback
    return 0 if feedback is None else feedback.event


async def _pictures(stack: Stack, camera: str) -> float:
    """Return the number of pictures that the console has encoded."""
    return (await stack.metrics()).values("lockstep_media_pictures_taken_total", "stream").get(camera, 0.0)


def _spent(stack: Stack, microphones: Collection[str]) -> tuple[float, float, float, float, float]:
    """Return the processor seconds so far, in the order of `Cost`."""
    bridge, console = stack.bridge.process.usage.thread_seconds(), stack.console.usage.thread_seconds()
    drawing = sum(seconds for name, seconds in bridge.items() if name.startswith("render"))
    sounding = {f"media-{name}"[:THREAD_NAME] for name in microphones}
    encoding = {name: seconds for name, seconds in console.items() if name.startswith("media-")}
    sound = sum(seconds for name, seconds in encoding.items() if name in sounding)
    both = sum(encoding.values())
    return drawing, sum(bridge.values()) - drawing, both - sound, sound, sum(console.values()) - both


def _results(cost: Cost, camera: str, seconds: float) -> list[Result]:
    is_starved = cost.rate < RATE_TARGET  # less was done than the target counts
    conditions = (
        f"{DEFAULT_ROBOT} driven at {cost.events:.0f} events/s by one peer that receives all, H.264; all cameras at "
        f"full size and rate, quality controller off; {seconds:.0f} s of processor time"
        + ("; the machine had no time for all pictures, so the sum says nothing" if is_starved else "")
    )

    def row(name: str, value: float | None, unit: str = "% of one core", **more: object) -> Result:
        return Result(section=SECTION, name=name, value=value, unit=unit, conditions=conditions, **more)  # type: ignore[arg-type]

    held = cost.drawing + cost.bridge + cost.pictures + cost.sound
    return [
        row("bridge: drawing both cameras", cost.drawing),
        row("bridge: simulation, sound, robot link", cost.bridge),
        row("console: encoding pictures", cost.pictures),
        row("console: encoding sound", cost.sound),
        row(HELD, None if is_starved else held, target=TARGET),
        row("console: all else for one peer", cost.console),
        row(f"pictures of {camera}", cost.rate, "per second", target=RATE_TARGET, bound="at least"),
    ]
