"""A policy that is killed while it drives in an episode. The person who let it drive goes on, and keeps the episode."""

import asyncio
import sys
from typing import Final

from lockstep.bench.episodes.dataset import Kept
from lockstep.bench.episodes.faults.fault_run import SECONDS, TASK, FaultRun
from lockstep.bench.episodes.plan import DRIVERS, POLICY
from lockstep.bench.episodes.policy_turn import take_over
from lockstep.bench.episodes.turns import Turn
from lockstep.bench.harness.processes import Running, started

__all__ = ["kill_policy"]

PROGRAM: Final = "lockstep.bench.episodes.faults.policy_process"
EVENTS: Final = 8  # that it drives before it is killed


async def kill_policy(run: FaultRun) -> None:
    async with started((sys.executable, "-m", PROGRAM, run.policy_link, DRIVERS[POLICY])) as policy:
        peer = str((await policy.read(SECONDS))["peer"])
        episode = await run.driver.episodes.start(TASK)
        first = run.state.first_event
        await run.driver.rest()
        name = await _name_of(run, peer)
        began = run.event
        await run.driver.policies.offer(peer)
        if not await _killed_as_it_drives(run, policy, began):
            return
        ended = run.event
        await take_over(run.driver)
        run.said.append(f"{run.state.phase}, the policy drove {ended - began} events")
        last = await run.drive()
    turns = (Turn(name, "policy", began + 1, ended), Turn(run.name, "human", ended + 1, last))
    await run.keep(Kept(episode, "success", first, last, turns, run.name))


async def _name_of(run: FaultRun, peer: str) -> str:
    """Return the name that the console gave it: "net 2" where somebody is called "net" already."""
    async with asyncio.timeout(SECONDS):
        async for _ in run.driver.feedbacks():
            for each in run.driver.participants:
                if each.peer == peer:
                    return each.name
    raise RuntimeError("the driver's feedbacks have ended")


async def _killed_as_it_drives(run: FaultRun, policy: Running, began: int) -> bool:
    try:
        async with asyncio.timeout(SECONDS):
            async for feedback in run.driver.feedbacks():
                if feedback.event >= began + EVENTS and not feedback.at_rest:
                    await policy.kill()
                    break
            async for feedback in run.driver.feedbacks():
                if feedback.at_rest:
                    return True
    except TimeoutError:
        run.wrong.append("the policy never drove, or the robot did not come to rest without it")
    return False
