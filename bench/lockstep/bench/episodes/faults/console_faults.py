"""A console that is killed in each phase of an episode."""

import asyncio
from contextlib import suppress

from lockstep.bench.episodes.faults.fault_run import TASK, FaultRun
from lockstep.client import ConsoleLost, EpisodeRefused

__all__ = ["kill_countdown", "kill_keeping", "kill_open", "kill_reset"]


async def kill_countdown(run: FaultRun) -> None:
    async def start() -> None:
        with suppress(ConsoleLost, EpisodeRefused):
            await run.driver.episodes.start(TASK)

    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(start())
        await run.until(lambda state: state.phase == "countdown", "a count-down")
        await run.kill_console()


async def kill_open(run: FaultRun) -> None:
    await run.begun()
    if run.state.phase != "open":
        run.wrong.append(f"the console said {run.state.phase}, not open")
    await run.kill_console()


async def kill_keeping(run: FaultRun) -> None:
    second = await run.begun()
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(run.keep(second))
        await run.until(lambda state: state.phase != "open", "that it keeps the episode")
        await run.kill_console()


async def kill_reset(run: FaultRun) -> None:
    """Kill the console while the robot goes home after a kept episode."""
    await run.keep_one()
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(run.go_home())
        await run.until_it_moves()
        await run.kill_console()
