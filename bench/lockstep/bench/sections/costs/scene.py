"""Measures whether viewers of the 3D scene slow the operator down.

The operator drives without viewers and with three, in turns, so that the machine's other work falls on both alike. The
viewers are WebSocket clients of the console's scene, in a separate process; they draw nothing.
"""

import asyncio
import sys

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.driving import console_trips
from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import DEFAULT_ROBOT, Stack, running_stack
from lockstep.client import Console

__all__ = ["run"]

SECTION = "scene"
VIEWERS = 3
TURNS, QUICK_TURNS = 5, 1
EVENTS, QUICK_EVENTS = 120, 30  # of a turn, with and without viewers each
SETTLE = 1.0  # s after they came or went
TARGET = 1.1  # times the median without viewers
ANSWER_SECONDS = 10.0


async def run(context: Context) -> list[Result]:
    robot = DEFAULT_ROBOT if DEFAULT_ROBOT in context.robots else context.robots[0]
    alone: list[float] = []
    watched: list[float] = []
    received = 0
    async with running_stack(robot) as stack, Console(stack.operator, name="operator", decode=False) as operator:
        await operator.take_seat()
        await console_trips(operator, 10)
        for _ in range(context.scale(TURNS, QUICK_TURNS)):
            alone += await _drive(operator, context)
            trips, amount = await _watched(stack, operator, context)
            watched += trips
            received += amount
    return _results(robot, alone, watched, received)


async def _drive(operator: Console, context: Context) -> list[float]:
    await asyncio.sleep(SETTLE)
    trips = await console_trips(operator, context.scale(EVENTS, QUICK_EVENTS))
    await operator.rest()
    return [trip.seconds * 1000 for trip in trips]


async def _watched(stack: Stack, operator: Console, context: Context) -> tuple[list[float], int]:
    """Return the trips in ms, and the bytes that the viewers got meanwhile."""
    command = (sys.executable, "-m", "lockstep.bench.viewers.scene_viewers", stack.observer, str(VIEWERS))
    async with running_process(*command) as (viewers, _):
        before = await viewers.ask("count", ANSWER_SECONDS)
        trips = await _drive(operator, context)
        after = await viewers.ask("count", ANSWER_SECONDS)
    got = [late - early for early, late in zip(before["received"], after["received"], strict=True)]
    if not all(got):
        raise RuntimeError("a viewer of the scene got nothing")
    return trips, sum(got)


def _results(robot: str, alone: list[float], watched: list[float], received: int) -> list[Result]:
    conditions = (
        f"{robot} driven, {len(watched)} events with {VIEWERS} viewers of the scene ({received / 1e6:.1f} MB) and "
        f"{len(alone)} without, in turns"
    )

    def row(name: str, value: float, unit: str, **more: object) -> Result:
        return Result(section=SECTION, name=name, value=value, unit=unit, conditions=conditions, **more)  # type: ignore[arg-type]

    without = {"baseline_name": "the same operator without viewers"}
    return [
        row("operator's command → feedback, median", median(watched), "ms", baseline=median(alone), **without),
        row("p99", quantile(watched, 0.99), "ms", baseline=quantile(alone, 0.99), **without),
        row("median with viewers to median without", median(watched) / median(alone), "×", target=TARGET),
    ]
