"""Measures whether the console's memory stays flat, over ten minutes with an operator who drives and observers.

The observers come and go. The baseline is plain aiortc (`bench.baseline_server`) with as many peers of the main camera,
coming and going alike, at the same time at the same bridge. Growth compares the medians of the first and the last
quarter after a warm-up of a quarter of the time (`bench/lockstep/bench/soak/memory.py`).

Then the same is measured without comings and goings: two hundred observers who stay, headless and counting only.
"""

import asyncio
import sys
import time
from contextlib import AsyncExitStack

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.harness.driving import console_trips
from lockstep.bench.harness.processes import Running, running_process
from lockstep.bench.harness.stack import running_stack
from lockstep.bench.soak.memory import growth
from lockstep.bench.viewers.idle_crowd import idle_crowd
from lockstep.client import Console

__all__ = ["run"]

SECTION = "memory"
SECONDS, QUICK_SECONDS = 600, 20
OBSERVERS, TURNOVER = 5, 5  # observers that stay; observers that come and go together
CROWD, QUICK_CROWD = 200, 5
CROWD_SECONDS = 300
STAY = 8.0  # s that a visitor stays
CONNECT_SECONDS = 60.0
EVENTS = 10_000_000  # more than fit into the time
ROBOT = "planar"
GROWTH_TARGET = 5.0  # %
SAMPLE_SECONDS = 1.0
MEGABYTE = 1e6


async def run(context: Context) -> list[Result]:
    return [*await _coming_and_going(context), *await _many(context)]


async def _many(context: Context) -> list[Result]:
    count, seconds = context.scale(CROWD, QUICK_CROWD), float(context.scale(CROWD_SECONDS, QUICK_SECONDS))
    async with (
        running_stack(ROBOT) as stack,
        Console(stack.operator, name="operator", decode=False) as console,
        idle_crowd(stack.observer, count, context),
        asyncio.TaskGroup() as tasks,
    ):
        await console.take_seat()
        driving = tasks.create_task(console_trips(console, EVENTS, seconds=seconds))
        (samples,) = await _samples([stack.console], seconds, context)
        trips = await driving
    conditions = f"{seconds / 60:.1f} minutes, {len(trips)} events driven, {count} observers who stay"

    def row(name: str, value: float | None, unit: str, target: float | None = None) -> Result:
        return Result(
            section=SECTION,
            name=f"{count} observers: {name}",
            value=value,
            unit=unit,
            target=target,
            samples=len(samples),
            conditions=conditions,
        )

    return [
        row("growth after the warm-up", _percent(growth(samples)), "%", GROWTH_TARGET),
        row("at the end", samples[-1] / MEGABYTE, "MB"),
    ]


async def _coming_and_going(context: Context) -> list[Result]:
    seconds = float(context.scale(SECONDS, QUICK_SECONDS))
    async with running_stack(ROBOT) as stack, AsyncExitStack() as others:
        command = (sys.executable, "-m", "lockstep.bench.baseline.baseline_server", stack.bridge.address)
        rival, ready = await others.enter_async_context(running_process(*command))
        await _audience(others, stack.observer, OBSERVERS)
        await _audience(others, ready["console"], OBSERVERS, "plain")
        console = await others.enter_async_context(Console(stack.operator, name="operator", decode=False))
        await console.take_seat()
        async with asyncio.TaskGroup() as tasks:
            visits = tasks.create_task(_visits(stack.observer, ready["console"]))
            driving = tasks.create_task(console_trips(console, EVENTS, seconds=seconds))
            ours, theirs = await _samples([stack.console, rival], seconds, context)
            visits.cancel()
            trips = await driving
    return _results(seconds, ours, theirs, len(trips))


async def _audience(stack: AsyncExitStack, link: str, count: int, *how: str) -> None:
    command = (sys.executable, "-m", "lockstep.bench.viewers.audience", link, str(count), *how)
    await stack.enter_async_context(running_process(*command, ready_seconds=CONNECT_SECONDS))


async def _visits(link: str, plain_link: str) -> None:
    """Let a group join both, stay a while and leave, again and again until cancelled."""
    while True:
        async with AsyncExitStack() as group:
            await _audience(group, link, TURNOVER)
            await _audience(group, plain_link, TURNOVER, "plain")
            await asyncio.sleep(STAY)


async def _samples(processes: list[Running], seconds: float, context: Context) -> list[list[float]]:
    """Return the bytes of each process, once a second."""
    found: list[list[float]] = [[] for _ in processes]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for samples, process in zip(found, processes, strict=True):
            samples.append(float(process.usage.resident_bytes()))
        if len(found[0]) % 60 == 0:
            context.say(f"{len(found[0]) // 60} min: " + ", ".join(f"{each[-1] / MEGABYTE:.0f} MB" for each in found))
        await asyncio.sleep(SAMPLE_SECONDS)
    return found


def _results(seconds: float, ours: list[float], theirs: list[float], events: int) -> list[Result]:
    conditions = (
        f"{seconds / 60:.1f} minutes, {events} events driven, {OBSERVERS} observers that stay and {TURNOVER} that come "
        f"and go every {STAY:.0f} s"
    )
    plain = "plain aiortc, as many peers of the main camera, encoded per peer"

    def row(name: str, value: float | None, baseline: float | None, unit: str, target: float | None = None) -> Result:
        known = {"section": SECTION, "samples": len(ours), "conditions": conditions, "baseline_name": plain}
        return Result(name=name, value=value, baseline=baseline, unit=unit, target=target, **known)  # type: ignore[arg-type]

    return [
        row("growth after the warm-up", _percent(growth(ours)), _percent(growth(theirs)), "%", GROWTH_TARGET),
        row("at the end", ours[-1] / MEGABYTE, theirs[-1] / MEGABYTE, "MB"),
        row("largest", max(ours) / MEGABYTE, max(theirs) / MEGABYTE, "MB"),
    ]


def _percent(share: float | None) -> float | None:
    return None if share is None else share * 100
