"""A robot's bridge that is killed in each phase of an episode, and a camera that hangs."""

import asyncio
import signal

from lockstep.bench.episodes.faults.fault_run import FaultRun

__all__ = ["camera_hangs", "kill_robot", "kill_robot_keeping", "kill_robot_reset"]


async def kill_robot(run: FaultRun) -> None:
    await run.begun()
    await run.bridge.kill()
    await run.until(lambda state: state.phase == "idle", "the end of the episode")
    await run.refuses_to_keep()


async def kill_robot_keeping(run: FaultRun) -> None:
    """The episode has ended, and goes to the disk: nobody needs the robot for that."""
    second = await run.begun()
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(run.keep(second))
        await run.until(lambda state: state.phase != "open", "that it keeps the episode")
        await run.bridge.kill()
    run.said.append(run.state.last)


async def kill_robot_reset(run: FaultRun) -> None:
    """Kill the bridge while the robot goes home after a kept episode."""
    await run.keep_one()
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(run.go_home())
        await run.until_it_moves()
        run.said.append(f"{run.state.phase}, {run.state.kept} kept")
        await run.bridge.kill()


async def camera_hangs(run: FaultRun) -> None:
    """One episode in the middle of which a camera hangs, and is kept all the same."""
    second = await run.begun()
    run.bridge.signal(signal.SIGUSR1)
    async with run.driving_on():
        await run.until(
            lambda state: any(each.kind == "camera_missing" for each in state.problems), "a camera is missing"
        )
    run.note_problems()
    await run.driver.episodes.success()
    run.kept.append(second)
