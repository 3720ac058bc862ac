"""Runs a fleet's soak: a driver for each robot, and bridges that are killed in turn."""

import asyncio
import random
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from lockstep.bench.fleet_soak.driver import FleetDriver
from lockstep.bench.fleet_soak.verdict import Span, fleet_verdict, robot_verdict
from lockstep.bench.fleet_soak.world import FleetWorld

__all__ = ["FleetPlan", "fleet_soak"]

CALM_SHARE = 0.25  # of the time, at the beginning, without a kill
LOOK_SECONDS = 0.05
START_SECONDS = 60.0  # until all robots are driven
RETURN_SECONDS = 30.0  # until a robot whose bridge was killed is driven again


class FleetPlan(NamedTuple):
    robots: int
    seconds: float  # of driving
    kill_every: float  # s
    seed: int
    rate: float  # events a second of each driver
    picture_rate: float | None  # Hz, of one camera, whose pictures the drivers get; 0: none; None: all cameras


async def fleet_soak(plan: FleetPlan, say: Callable[[str], None]) -> dict[str, Any]:
    """Run the soak, and return the counts by name; those of MUST_BE_ZERO must be 0.

    Raises:
        ProcessFailed: a bridge or the console did not start.
        TimeoutError: an operator could not drive at the beginning.
    """
    with TemporaryDirectory(prefix="lockstep-fleet-") as folder:
        async with FleetWorld(Path(folder), plan.robots, plan.picture_rate) as world:
            return await _Soak(plan, world, say).run()


class _Soak:
    def __init__(self, plan: FleetPlan, world: FleetWorld, say: Callable[[str], None]) -> None:
        self._plan = plan
        self._world = world
        self._say = say
        self._drivers = {
            name: FleetDriver(name, world.link(name), plan.rate, pictures=plan.picture_rate != 0)
            for name in world.names
        }
        self._kills: list[Span] = []
        self._never_back: list[str] = []
        self._held_up = 0.0  # s, longest time that this process did not run although it wanted to

    async def run(self) -> dict[str, Any]:
        plan = self._plan
        async with asyncio.TaskGroup() as tasks:
            watching = tasks.create_task(self._watch_machine())
            driving = [tasks.create_task(each.run(), name=each.name) for each in self._drivers.values()]
            async with asyncio.timeout(START_SECONDS):
                for driver in self._drivers.values():
                    await driver.driving.wait()
            began, cpu = time.monotonic(), self._world.console.usage.cpu_seconds()
            self._say(f"all {plan.robots} robots are driven; the calm phase lasts {CALM_SHARE * plan.seconds:.0f} s")
            await asyncio.sleep(CALM_SHARE * plan.seconds)
            calm = Span(began, time.monotonic(), "")
            await self._kill_until(began + plan.seconds)
            spent, lasted = self._world.console.usage.cpu_seconds() - cpu, time.monotonic() - began
            memory = self._world.console.usage.resident_bytes()
            for task in (*driving, watching):
                task.cancel()
        robots = {name: robot_verdict(driver, self._world.records(name)) for name, driver in self._drivers.items()}
        return {
            **fleet_verdict(list(self._drivers.values()), robots, calm, self._kills),
            "never_back": self._never_back,
            "seconds": round(lasted, 1),
            "seed": plan.seed,
            "console_processor_share": round(spent / lasted, 3),
            "machine_held_up_ms": round(self._held_up * 1000, 1),
            "console_megabytes": round(memory / 1e6, 1),
        }

    async def _kill_until(self, end: float) -> None:
        """Kill one bridge after the other; each is driven again before the next is killed."""
        due = time.monotonic()
        for name in self._order():
            if due >= end:
                return
            await asyncio.sleep(max(0.0, due - time.monotonic()))
            await self._kill(name)
            due = max(due + self._plan.kill_every, time.monotonic())

    async def _watch_machine(self) -> None:
        """Measure delays of this process: a machine without time for its processes breaks links, not the console."""
        while True:
            due = time.monotonic() + LOOK_SECONDS
            await asyncio.sleep(LOOK_SECONDS)
            self._held_up = max(self._held_up, time.monotonic() - due)

    def _order(self) -> Iterator[str]:
        """Yield all robots in turn, every round in another order."""
        chance = random.Random(self._plan.seed)
        while True:
            yield from chance.sample(self._world.names, len(self._world.names))

    async def _kill(self, name: str) -> None:
        driver, began = self._drivers[name], time.monotonic()
        driver.bridge_dies()
        await self._world.kill(name)
        try:
            async with asyncio.timeout(RETURN_SECONDS):
                await driver.driving.wait()
        except TimeoutError:
            self._never_back.append(name)
        self._kills.append(Span(began, time.monotonic(), name))
        self._say(f"{name} died and is driven again after {time.monotonic() - began:.1f} s")
