"""`python -m lockstep.bench.robot_cuts.operator LINK CA FILE`: an operator who watches and always holds the stick.

Each intention differs a little from the last and is written to the file as `[time, value]`, so that the robot's log
tells when an executed one was formed.
"""

import asyncio
import contextlib
import itertools
import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from lockstep.client import CommandRefused, Console, ConsoleError, NotArmed

__all__ = ["hold"]

STEP = 0.05  # s between two intentions
MARK = 1e-5  # by which each differs from the one before
SILENCE = 60.0  # s: the console is not cut off, its robot is


async def hold(link: str, authority: Path, file: Path) -> None:
    """Drive until cancelled, and take control again as soon as that is possible."""
    marks = itertools.count(1)
    with file.open("a", buffering=1) as intentions:
        while True:
            with contextlib.suppress(ConsoleError):
                async with Console(
                    link, decode=False, silence_seconds=SILENCE, tls_ca=authority, name="operator"
                ) as console:
                    await _drive(console, intentions.write, marks)
            await asyncio.sleep(STEP)


async def _drive(console: Console, write: Callable[[str], int], marks: Iterator[int]) -> None:
    turns = [0.0] * (len(console.description.axes) - 2)
    await console.take_seat()
    while True:
        formed, value = time.monotonic(), 0.2 + next(marks) * MARK
        write(json.dumps([formed, value]) + "\n")
        try:
            async with asyncio.timeout(STEP):
                await console.drive([value, *turns, 0.8])
        except TimeoutError:
            continue  # in flight; the next intention takes its place
        except NotArmed:
            with contextlib.suppress(CommandRefused):
                await console.arm()
        except CommandRefused as refused:
            if refused.reason == "no_seat":
                await console.take_seat()
        await asyncio.sleep(max(0.0, formed + STEP - time.monotonic()))


if __name__ == "__main__":
    asyncio.run(hold(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])))
