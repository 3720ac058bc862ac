"""One run of a day: pages in two browsers, some by way of two Janus servers, while a plan of disturbances runs."""

import asyncio
import datetime
import time
from collections import Counter
from collections.abc import Callable
from contextlib import AsyncExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx

from lockstep.bench.browsers.chromium import PAD, running_chromium
from lockstep.bench.browsers.firefox import running_firefox
from lockstep.bench.browsers.probed_page import open_probed_page
from lockstep.bench.harness.stack import LOCKSTEP
from lockstep.bench.soak.crowd import Crowd, Intruder
from lockstep.bench.soak.judge import Judge
from lockstep.bench.soak.memory import Sample, growth, growth_alike
from lockstep.bench.soak.pages import FirefoxDocument, OperatorPage, WatchedPage
from lockstep.bench.soak.world import World
from lockstep.bench.soak_day.day import Action, Leg, drift, plan
from lockstep.bench.soak_day.hand_over import take_over
from lockstep.bench.soak_day.relays import Relays
from lockstep.emulator import Network, load_profile

__all__ = ["run_leg"]

Say = Callable[[str], None]

SAMPLE_SECONDS = 2.0
LAST_LOOK = 45.0  # s at the end for everybody to be live again
NEWS_SECONDS = 60.0
MAX_EVENT_AGE, HOLD = 2.0, 0.3  # of the planar robot
CROWD = 4  # headless observers at most, which come and go
CALM = 10.0  # s without a disturbance after which delays are compared
VERIFY_SECONDS = 300.0


async def run_leg(minutes: float, seed: int, say: Say) -> Leg:
    """Carry out the plan, and return the actions that were done and the findings.

    Raises:
        NoAddress, FileNotFoundError, ProcessFailed: a part could not be started.
    """
    with TemporaryDirectory(prefix="lockstep-day-") as name:
        folder = Path(name)
        relays = Relays(folder)
        async with AsyncExitStack() as stack:
            stack.push_async_callback(relays.end)
            await relays.begin()
            # A relay encodes nothing again, and Firefox decodes H.264 only with a plugin that Debian has not.
            world = World(folder, *relays.options, "--observers-direct", "0", LOCKSTEP_RELAY_CODEC="VP8")
            await stack.enter_async_context(world)
            network = await stack.enter_async_context(Network(load_profile("perfect"), robot=world.robot, seed=seed))
            await world.open_console(network.robot_address)
            await network.open_console(world.console_url)
            leg = _Leg(world, network, relays, minutes, seed, say)
            await leg.run(stack)
        return leg.found(await _broken_recordings(folder, say))


class _Leg:
    def __init__(self, world: World, network: Network, relays: Relays, minutes: float, seed: int, say: Say) -> None:
        self._world, self._network, self._relays = world, network, relays
        self._minutes, self._seed, self._say = minutes, seed, say
        self._done: Counter[str] = Counter()
        self._relayed: Counter[str] = Counter()
        self._memory: list[Sample] = []  # of the console's present life
        self._feedback: list[float] = []  # ms, medians while all was calm
        self._picture: list[float] = []
        self._pages: dict[str, WatchedPage] = {}
        self._crowd = Crowd(network.link(world.observer), CROWD, seed)
        self._intruder = Intruder(network.link(world.observer), "observer that commands")
        self._began = datetime.datetime.now(datetime.UTC)
        self._begin = time.monotonic()

    async def run(self, stack: AsyncExitStack) -> None:
        operator, observer = self._network.link(self._world.operator), self._network.link(self._world.observer)
        calm = self._world.calm
        chromium = await stack.enter_async_context(running_chromium())
        firefox = await stack.enter_async_context(running_firefox())
        self._pages["chromium, driving"] = driving = OperatorPage(
            await stack.enter_async_context(open_probed_page(chromium, operator, PAD)), calm
        )
        for number in (1, 2):
            page = await stack.enter_async_context(open_probed_page(chromium, observer))
            self._pages[f"chromium, watching {number}"] = WatchedPage(page, calm)
        await firefox.open(observer)
        self._pages["firefox, watching"] = WatchedPage(FirefoxDocument(firefox, observer), calm)
        async with asyncio.TaskGroup() as tasks:  # a task's failure ends the run
            self._crowd.fill(tasks)
            background = [tasks.create_task(page.run()) for page in self._pages.values()]
            background.append(tasks.create_task(self._intruder.run()))
            background.append(tasks.create_task(self._sample(driving)))
            background.append(tasks.create_task(self._tell()))
            await self._play(plan(self._minutes, self._seed), tasks)
            self._say("the plan is played; waiting for everybody to be back")
            await self._until_live()
            for task in background:
                task.cancel()
            await self._crowd.close()

    async def _play(self, actions: list[Action], tasks: asyncio.TaskGroup) -> None:
        for action in actions:
            await asyncio.sleep(max(0.0, self._begin + action.at - time.monotonic()))
            self._say(f"{time.monotonic() - self._begin:7.1f} s  {action.kind} {round(action.seconds, 1) or ''}")
            if await self._act(action, tasks):
                self._done[action.kind] += 1
        await asyncio.sleep(max(0.0, self._begin + self._minutes * 60 - LAST_LOOK - time.monotonic()))

    async def _act(self, action: Action, tasks: asyncio.TaskGroup) -> bool:
        """Do the action, and return whether it was done; while the console is down, it is not."""
        match action.kind:
            case "hand_over":
                return await take_over(self._network.link(self._world.supervisor))
            case "join":
                self._crowd.come(tasks)
            case "leave":
                await self._crowd.go()
            case "cut_network":
                await self._cut(action.seconds)
            case "stop":
                await self._stop(action.seconds)
            case "kill_bridge":
                await self._world.kill_bridge()
            case "restart_console":
                self._memory.clear()
                await self._world.restart_server(gently=self._done["restart_console"] % 2 == 0)
                self._memory.clear()
            case "kill_relay":
                with self._world.calm.trouble():
                    await self._relays.kill_one()
            case "begin_recording":
                return await self._record("/api/recordings", {"name": f"day {self._done['begin_recording']}"})
            case "end_recording":
                return await self._record("/api/recordings/stop")
        return True

    async def _cut(self, seconds: float) -> None:
        """Cut the network: packets are lost, or wait until its end, in turn. Every fourth is on the robot link."""
        turn = self._done["cut_network"]
        with self._world.calm.trouble():
            self._network.outage(seconds, hold=turn % 2 == 1, robot=turn % 4 == 3)
            await asyncio.sleep(seconds)

    async def _stop(self, seconds: float) -> None:
        with self._world.calm.trouble():
            await self._world.stop_for(seconds)
            await self._world.until_reset()

    async def _record(self, path: str, body: dict[str, str] | None = None) -> bool:
        token = self._world.supervisor.partition("#token=")[2]
        headers = {"Authorization": f"Bearer {token}"}
        async with httpx.AsyncClient(base_url=self._world.console_url, timeout=30.0, trust_env=False) as http:
            with suppress(httpx.TransportError):
                answer = await http.post(path, headers=headers, json=body or {})
                return answer.is_success or answer.status_code == httpx.codes.CONFLICT  # it is so already
        return False

    async def _until_live(self) -> None:
        """Wait until every page shows new pictures; one that does not is counted as a reload."""
        for page in self._pages.values():
            try:
                async with asyncio.timeout(LAST_LOOK / len(self._pages)):
                    await page.until_live()
            except TimeoutError:
                page.reloads += 1

    async def _sample(self, driving: OperatorPage) -> None:
        """Note the console's memory, the operator's delays while all is calm, and the number of pictures by relay."""
        seen = dict.fromkeys(self._pages, 0)
        while True:
            encoders, memory = await self._world.open_encoders(), self._world.server_memory()
            if encoders is not None and memory is not None:
                self._memory.append(Sample(float(memory), encoders))
            found = driving.statistics
            if found is not None and found["driving"] and self._world.calm.seconds() > CALM:
                self._note(self._feedback, found["command_to_feedback_ms"]["median"])
                self._note(self._picture, found["picture_delay_p50_ms"])
            for name, page in self._pages.items():
                relay = (page.statistics or {}).get("relay") or "the console"
                self._relayed[relay] += page.rendered - seen[name]
                seen[name] = page.rendered
            await asyncio.sleep(SAMPLE_SECONDS)

    @staticmethod
    def _note(samples: list[float], value: float | None) -> None:
        if value is not None:
            samples.append(value)

    async def _tell(self) -> None:
        while True:
            await asyncio.sleep(NEWS_SECONDS)
            pictures = sum(page.rendered for page in self._pages.values())
            violations = sum(page.violations for page in self._pages.values())
            self._say(f"{time.monotonic() - self._begin:7.1f} s  {pictures} pictures, {violations} violations")

    def found(self, recordings_broken: int) -> Leg:
        judge = Judge(MAX_EVENT_AGE, HOLD)
        judge.read(self._world.records())
        verdict: dict[str, Any] = judge.verdict
        alike = growth_alike(self._memory)
        return Leg(
            began=self._began.isoformat(timespec="seconds"),
            seconds=round(time.monotonic() - self._begin, 1),
            seed=self._seed,
            done=dict(self._done),
            pictures={name: page.rendered for name, page in self._pages.items()},
            relayed=dict(self._relayed),
            broken={
                **{name: verdict[name] for name in ("executed_twice", "executed_late")},
                **{name: verdict[name] for name in ("moved_without_seat", "moved_while_stopped")},
                "reloads_needed": sum(page.reloads for page in self._pages.values()),
                "violations": sum(page.violations for page in self._pages.values()),
                "recordings_broken": recordings_broken,
            },
            executed=verdict["executed"],
            memory_growth=growth([sample.resident for sample in self._memory]) if alike is None else alike,
            feedback_drift=drift(self._feedback),
            picture_drift=drift(self._picture),
        )


async def _broken_recordings(folder: Path, say: Say) -> int:
    """Return how many recordings `lockstep verify` finds broken, or cannot read."""
    broken = 0
    for file in sorted((folder / "state").rglob("*.mcap")):
        process = await asyncio.create_subprocess_exec(
            *(LOCKSTEP, "verify", str(file), "--state-dir", str(folder / "state")),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
        )
        async with asyncio.timeout(VERIFY_SECONDS):
            said, _ = await process.communicate()
        if process.returncode != 0:
            broken += 1
            say(f"{file.name}: {said.decode(errors='replace')[-2000:]}")
    return broken
