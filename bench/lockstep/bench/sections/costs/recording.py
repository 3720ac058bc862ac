"""Measures the cost of a recording for the operator: command to feedback with the recorder off and on.

The two alternate in one run.
"""

import httpx

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.driving import Trip, console_trips
from lockstep.bench.harness.event_log import robot_times
from lockstep.bench.harness.stack import running_stack
from lockstep.client import Console

__all__ = ["run"]

SECTION = "recording"
EVENTS, QUICK_EVENTS = 150, 40  # of a turn
TURNS = 4  # of each kind; in turns, so that the machine's other work falls on both
ALLOWED_MS = 0.5  # more than without, of the console's own share
ALLOWED_TIMES = 1.1  # that without, of command -> feedback


async def run(context: Context) -> list[Result]:
    count = context.scale(EVENTS, QUICK_EVENTS)
    results: list[Result] = []
    for robot in context.robots:
        off, on, own_off, own_on = await _turns(robot, count)
        whole, own = f"{robot}: command → feedback while recording", f"{robot}: console's own share while recording"
        results += _compare(whole, off, on, median(off) * ALLOWED_TIMES)
        results += _compare(own, own_off, own_on, median(own_off) + ALLOWED_MS)
    return results


async def _turns(robot: str, count: int) -> tuple[list[float], list[float], list[float], list[float]]:
    """Return each trip, without and with a recording, and the part of it that is not the robot's, in ms."""
    async with running_stack(robot) as stack, httpx.AsyncClient(base_url=stack.url, trust_env=False) as http:
        http.headers["Authorization"] = f"Bearer {stack.operator.partition('token=')[2].partition('&')[0]}"
        async with Console(stack.operator, name="bench", codec="H264") as console:
            await console.take_seat()
            await console_trips(console, 10)
            trips: dict[bool, list[Trip]] = {False: [], True: []}
            for _ in range(TURNS):
                for recording in (False, True):
                    path = "/api/recordings" if recording else "/api/recordings/stop"
                    (await http.post(path)).raise_for_status()
                    trips[recording] += await console_trips(console, count)
            (await http.post("/api/recordings/stop")).raise_for_status()
        robot_share = robot_times(stack.bridge.event_log)
        off, on = ([trip.seconds * 1000 for trip in trips[kind]] for kind in (False, True))
        own_off, own_on = (
            [(trip.seconds - robot_share[trip.event]) * 1000 for trip in trips[kind] if trip.event in robot_share]
            for kind in (False, True)
        )
        return off, on, own_off, own_on


def _compare(what: str, off: list[float], on: list[float], target: float) -> list[Result]:
    def row(name: str, value: float, baseline: float, target: float | None) -> Result:
        return Result(
            section=SECTION,
            name=f"{what}, {name}",
            value=value,
            unit="ms",
            target=target,
            baseline=baseline,
            baseline_name="the same, not recording",
            samples=len(on),
            conditions="H.264 pictures of all cameras and sound to one operator, recorded in turns",
        )

    return [
        row("median", median(on), median(off), target),
        row("p99", quantile(on, 0.99), quantile(off, 0.99), None),
    ]
