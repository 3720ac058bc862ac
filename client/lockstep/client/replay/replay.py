"""Replays one episode on a robot: to its beginning, slowly, then along its rows."""

import asyncio
from contextlib import suppress

from lockstep.client.console import Console
from lockstep.client.errors import ConsoleError
from lockstep.client.replay.replay_core import ReplayCore, ReplayReport
from lockstep.client.replay.trajectory import Trajectory, fit

__all__ = ["APPROACH", "replay"]

APPROACH = 0.25  # of the axes' speed, on the way to the beginning


async def replay(
    console: Console, trajectory: Trajectory, *, pace: float = 1.0, from_anywhere: bool = False
) -> ReplayReport:
    """Take the seat, go to where the episode begins, and drive along it. The robot rests at the end, and on any error.

    Nobody else has to be driving, and the robot must not be stopped. Each row is a command like any other: it needs the
    answer of the one before, the bridge bounds its speed, and a refusal ends the replay.

    Args:
        pace: 1: as fast as it was recorded; below 1 slower
        from_anywhere: go to the beginning however far it is; else no goal axis may be further away than its `reach`

    Raises:
        ReplayUnfit: the recording is of another robot.
        ReplayTooFar: the robot is not where the episode begins; nothing has moved.
        ReplayDeviated: the robot did not follow.
        GoalNotReached: it did not get to the beginning.
        SeatRefused, CommandRefused, ConsoleLost: as for `Console.drive`.
    """
    core = ReplayCore(fit(trajectory, console.description), console.description, pace)
    clock = asyncio.get_running_loop().time
    await console.take_seat()
    try:
        feedback = await console.arm()
        if not from_anywhere:
            core.check_start(feedback)
        if core.start:
            feedback = await console.move_to(core.start, speed=APPROACH)
        began = clock()
        while (values := core.values(clock() - began, feedback)) is not None:
            feedback = await console.drive(values)
            core.heard(feedback)
    except BaseException:
        with suppress(ConsoleError):  # the first error counts; the bridge brings the robot to rest in any case
            await console.rest()
        raise
    await console.rest()
    return core.report
