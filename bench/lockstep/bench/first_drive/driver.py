"""Drives a robot until it has moved: `python -m lockstep.bench.first_drive.driver LINK`."""

import asyncio
import sys
from collections.abc import Sequence

from lockstep.bench.harness.asked import say
from lockstep.bench.harness.driving import axis_values, drive_on
from lockstep.client import Console

__all__ = ["drive_until_moved"]

SHARE = 0.3  # of the first axis' largest speed
MOVED = 0.01  # of the unit of any joint
LONGEST = 60.0  # s, until it moves


async def drive_until_moved(link: str) -> int:
    """Drive the first axis until a joint has moved; return the event in which it had.

    As a person would, this lets go of the controls when the robot names another fault, until it is at rest: a robot
    that could not be seen or did not listen moves only when they were let go since.

    Raises:
        TimeoutError: none moves; with what the robot says of itself.
    """
    async with Console(link, video=False, audio=False, name="first drive") as console:
        await console.take_seat()
        axes = console.description.axes
        speed = axis_values(axes, {0: SHARE * axes[0].maximum})
        rest = axis_values(axes, {})
        first = last = await drive_on(console, rest)
        seen: Sequence[str] = ()
        lets_go = False
        end = asyncio.get_running_loop().time() + LONGEST
        while max(abs(now - then) for now, then in zip(last.joints, first.joints, strict=True)) < MOVED:
            trouble = (*last.faults, *last.unknown)
            lets_go = trouble not in ((), seen) or (lets_go and not last.at_rest)
            seen = trouble
            if lets_go:
                first = last = await drive_on(console, rest)
            else:
                last = await drive_on(console, speed)
            if asyncio.get_running_loop().time() > end:
                raise TimeoutError(f"nothing moved in {LONGEST:g} s: {last}, {console.stats()}")
        await console.rest()
        return last.event


if __name__ == "__main__":
    say({"event": asyncio.run(drive_until_moved(sys.argv[1]))})
