"""Measures what goals add to the time from a command to its feedback, with the SO-101 and the headless client.

Neutral commands, which the robot executes in the same way but which have no goal, are the baseline: in turns with goals
over one connection, so that both meet the same machine. Goals of a joint are judged and shaped; those of the tool pass
the inverse kinematics as well. Each goal lies a little beside the one before, so that the arm moves all the while.
Then the processor time of the robot's own ticks, in which the inverse kinematics runs, alone in a process. Needs the
arm's model: lockstep robot fetch so101.
"""

import asyncio
import json
import math
import subprocess
import sys
import time
from collections.abc import Sequence

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.driving import Pause, applied_goals, drive_on
from lockstep.bench.harness.processes import ProcessFailed
from lockstep.bench.harness.stack import running_stack
from lockstep.client import Console, NotArmed
from lockstep.protocol.neutral import neutral_values

__all__ = ["run"]

SECTION = "goals"
ROBOT = "so101"
TURNS, QUICK_TURNS = 20, 2
EVENTS = 40  # of each kind in a turn
BASELINE = "neutral commands in turns with them"
NEUTRAL = ""
AXES = {"a joint's goals": "shoulder_pan", "goals of the tool": "tool.z"}
ALLOWED_TIMES = 1.10  # what goals may add to the median
TICKS_OF = ("so101", "mobile-manipulator-goals")
TICK_MS = 1.0
REACH = {"shoulder_pan": 0.05, "tool.z": 0.01}  # rad, m; how far the arm swings to each side
PERIOD = 2.0  # s


async def run(context: Context) -> list[Result]:
    try:
        trips = await _trips(context.scale(TURNS, QUICK_TURNS))
    except ProcessFailed:
        missing = "the SO-101 does not start here: lockstep robot fetch so101"
        return [Result(section=SECTION, name="goals", value=None, unit="ms", conditions=missing)]
    return [
        Result(
            section=SECTION,
            name=f"{ROBOT}: {kind}, {name}",
            value=of(trips[axis]),
            unit="ms",
            baseline=of(trips[NEUTRAL]),
            target=of(trips[NEUTRAL]) * ALLOWED_TIMES if of is median else None,
            baseline_name=BASELINE,
            samples=len(trips[axis]),
            conditions="pictures of all cameras received and decoded by the client meanwhile",
        )
        for kind, axis in AXES.items()
        for name, of in (("median", median), ("p99", _p99))
    ] + [row for robot in TICKS_OF for row in await _ticks(robot)]


async def _ticks(robot: str) -> list[Result]:
    """Measure the ticks of a robot whose tool is driven."""
    command = (sys.executable, "-m", "lockstep.bench.robots.ik_ticks", robot)
    done = await asyncio.to_thread(subprocess.run, command, capture_output=True, text=True, check=False)
    if done.returncode:
        return [
            Result(section=SECTION, name=f"{robot}: tick", value=None, unit="ms", conditions=done.stderr.strip()[-200:])
        ]
    found: dict[str, list[float]] = json.loads(done.stdout)
    whole = [sum(parts) for parts in zip(found["until_feedback"], found["ahead"], strict=True)]
    return [
        Result(
            section=SECTION,
            name=f"{robot}: tick with inverse kinematics, {part}, {name}",
            value=of(times),
            unit="ms",
            target=TICK_MS if of is median else None,
            samples=len(times),
            conditions="processor time of one thread",
        )
        for part, times in (("until its feedback", found["until_feedback"]), ("whole", whole))
        for name, of in (("median", median), ("p99", _p99))
    ]


def _p99(values: Sequence[float]) -> float:
    return quantile(values, 0.99)


async def _trips(turns: int) -> dict[str, list[float]]:
    """Return the times from command to feedback in ms, by the axis that had a goal."""
    kinds = (NEUTRAL, *AXES.values())
    trips: dict[str, list[float]] = {kind: [] for kind in kinds}
    async with running_stack(ROBOT, is_logged=False) as stack, Console(stack.operator, name="bench") as console:
        await console.take_seat()
        await drive_on(console, neutral_values(console.description.axes))
        for turn in range(turns):
            for kind in kinds:
                trips[kind] += await _turn(console, kind, seed=turn)
    return trips


async def _turn(console: Console, axis: str, *, seed: int) -> list[float]:
    """Drive `EVENTS` events, around where the axis is commanded to be; the first is not counted."""
    axes = console.description.axes
    neutral, pause = neutral_values(axes), Pause(console.description, seed)
    number = next((at for at, each in enumerate(axes) if each.name == axis), None)
    middle = 0.0 if number is None else applied_goals(console)[number]
    if middle is None:
        raise RuntimeError(f"the robot says no goal of {axis}")
    began = time.monotonic()

    def values(now: float) -> list[float | None]:
        found = list(neutral)
        if number is not None:
            found[number] = middle + REACH[axis] * math.sin((now - began) / PERIOD * math.tau)
        return found

    found: list[float] = []
    await drive_on(console, values(began))
    await pause.after(time.monotonic())
    while len(found) < EVENTS:
        sent = time.monotonic()
        try:
            await console.drive(values(sent))
            found.append((time.monotonic() - sent) * 1000)
        except NotArmed:  # a busy machine has held the robot up
            await drive_on(console, neutral)
        await pause.after(sent)
    await drive_on(console, neutral)
    return found
