"""Runs the soak: clients under a seeded plan of disturbances (schedule.py), judged by the bridge's record (judge.py).

The clients are one operator and an observer in Chromium, headless observers that come and go, and intruders.
"""

import asyncio
import time
from collections import Counter
from collections.abc import Callable
from contextlib import AsyncExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx

from lockstep.bench.browsers.chromium import PAD, running_chromium
from lockstep.bench.browsers.probed_page import open_probed_page
from lockstep.bench.harness.stack import Metrics
from lockstep.bench.soak.crowd import Crowd, Intruder
from lockstep.bench.soak.judge import Judge
from lockstep.bench.soak.memory import Sample, growth, growth_alike
from lockstep.bench.soak.pages import OperatorPage, WatchedPage
from lockstep.bench.soak.schedule import Action, schedule
from lockstep.bench.soak.world import World
from lockstep.emulator import Network, load_profile

__all__ = ["soak"]

SAMPLE_SECONDS = 2.0
LAST_LOOK = 45.0  # s at the end for everybody to be live again
READ_SECONDS = 1.0  # s between two looks at what the server counts
MAX_EVENT_AGE, HOLD = 2.0, 0.3  # of the planar robot


async def soak(minutes: float, seed: int, observers: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Run the soak, and return the results by name; the first six must be 0, memory_growth small.

    Args:
        observers: headless ones, beside a page in Chromium

    Raises:
        ProcessFailed: the bridge or the console did not start.
    """
    with TemporaryDirectory(prefix="lockstep-soak-") as folder:
        async with AsyncExitStack() as stack:
            world = await stack.enter_async_context(World(Path(folder)))
            network = await stack.enter_async_context(Network(load_profile("perfect"), robot=world.robot, seed=seed))
            await world.open_console(network.robot_address)
            await network.open_console(world.console_url)
            return await _Soak(world, network, minutes, seed, observers, say).run(stack)


class _Soak:
    def __init__(
        self, world: World, network: Network, minutes: float, seed: int, observers: int, say: Callable[[str], None]
    ) -> None:
        self._world = world
        self._network = network
        self._minutes = minutes
        self._seed = seed
        self._say = say
        self._done: Counter[str] = Counter()
        self._memory: list[Sample] = []  # of the server's present life
        self._crowd = Crowd(self._through(world.observer), observers, seed)
        self._intruders = [
            Intruder(self._through(world.observer), "observer that commands"),
            Intruder(self._through(world.operator), "operator without the seat"),
        ]

    async def run(self, stack: AsyncExitStack) -> dict[str, Any]:
        world = self._world
        browser = await stack.enter_async_context(running_chromium())
        operator = OperatorPage(
            await stack.enter_async_context(open_probed_page(browser, self._through(world.operator), PAD)),
            world.calm,
        )
        observer = WatchedPage(
            await stack.enter_async_context(open_probed_page(browser, self._through(world.observer))),
            world.calm,
        )
        async with asyncio.TaskGroup() as tasks:  # a task's failure ends the soak
            self._crowd.fill(tasks)
            background = [tasks.create_task(each.run()) for each in (operator, observer)]
            background += [tasks.create_task(each.run()) for each in self._intruders]
            background.append(tasks.create_task(self._sample_memory()))
            await self._play(schedule(self._minutes, self._seed), tasks)
            self._say("the plan is played; waiting for everybody to be back")
            await self._until_live(operator, observer)
            refused = await self._refusals()
            for task in background:
                task.cancel()
            await self._crowd.close()
        return self._verdict(operator, observer, refused)

    async def _play(self, plan: list[Action], tasks: asyncio.TaskGroup) -> None:
        began = time.monotonic()
        for action in plan:
            await asyncio.sleep(max(0.0, began + action.at - time.monotonic()))
            self._say(f"{time.monotonic() - began:6.1f} s  {action.kind} {action.seconds or ''}")
            await self._act(action, tasks)
            self._done[action.kind] += 1
        await asyncio.sleep(max(0.0, began + self._minutes * 60 - LAST_LOOK - time.monotonic()))

    async def _act(self, action: Action, tasks: asyncio.TaskGroup) -> None:
        match action.kind:
            case "kill_bridge":
                await self._world.kill_bridge()
            case "restart_server":
                self._memory.clear()
                await self._world.restart_server(gently=self._done["restart_server"] % 2 == 0)
                self._memory.clear()
            case "cut_network":
                await self._cut(action.seconds, self._done["cut_network"])
            case "stop":
                with self._world.calm.trouble():
                    await self._world.stop_for(action.seconds)
                    await self._world.until_reset()
            case "join":
                self._crowd.come(tasks)
            case "leave":
                await self._crowd.go()

    async def _cut(self, seconds: float, turn: int) -> None:
        """Cut the network: in turn packets are lost, or wait until the end; every fourth time on the robot link."""
        with self._world.calm.trouble():
            self._network.outage(seconds, hold=turn % 2 == 1, robot=turn % 4 == 3)
            await asyncio.sleep(seconds)

    async def _until_live(self, *pages: WatchedPage) -> None:
        """Wait until every page shows new pictures after all is calm; one that does not is counted as a reload."""
        for page in pages:
            try:
                async with asyncio.timeout(LAST_LOOK / len(pages)):
                    await page.until_live()
            except TimeoutError:
                page.reloads += 1

    async def _sample_memory(self) -> None:
        while True:
            encoders, memory = await self._world.open_encoders(), self._world.server_memory()
            if encoders is not None and memory is not None:
                self._memory.append(Sample(float(memory), encoders))
            await asyncio.sleep(SAMPLE_SECONDS)

    async def _refusals(self) -> dict[str, float]:
        """Return the refusals by reason since the server's last start, as soon as an intruder was refused."""
        end = time.monotonic() + LAST_LOOK
        refused = await self._refusals_until_now()
        while not refused.get("no_seat") and time.monotonic() < end:
            await asyncio.sleep(READ_SECONDS)
            refused = await self._refusals_until_now()
        return refused

    async def _refusals_until_now(self) -> dict[str, float]:
        async with httpx.AsyncClient(base_url=self._world.console_url, trust_env=False) as http:
            with suppress(httpx.TransportError):
                return Metrics((await http.get("/metrics")).text).values("lockstep_refusals_total", "reason")
        return {}

    def _verdict(self, operator: OperatorPage, observer: WatchedPage, refused: dict[str, float]) -> dict[str, Any]:
        judge = Judge(MAX_EVENT_AGE, HOLD)
        judge.read(self._world.records())
        found = judge.verdict
        overall, alike = growth([sample.resident for sample in self._memory]), growth_alike(self._memory)
        return {
            "executed_twice": found["executed_twice"],
            "executed_late": found["executed_late"],
            "moved_without_seat": found["moved_without_seat"],
            "moved_while_stopped": found["moved_while_stopped"],
            "reloads_needed": operator.reloads + observer.reloads,
            "violations": operator.violations + observer.violations,
            "memory_growth": overall if alike is None else alike,
            "memory_growth_overall": overall,
            "minutes": self._minutes,
            "seed": self._seed,
            "executed": found["executed"],
            "epochs": found["epochs"],
            "done": dict(self._done),
            "operator_armed": operator.arms,
            "seat_requests": operator.seat_requests,
            "slowest_return_seconds": round(max(operator.slowest_return, observer.slowest_return), 1),
            "observers_joined": self._crowd.joined,
            "intrusions": sum(each.tries for each in self._intruders),
            "refused": refused,
        }

    def _through(self, link: str) -> str:
        """Return the link by way of the emulated network."""
        return self._network.link(link)
