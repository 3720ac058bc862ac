"""An operator in a separate process: `python -m lockstep.bench.relay.driver LINK SECONDS` drives without end.

SECONDS pass between a feedback and the next command. Every second it prints a JSON line with the times from commands to
their feedback, and the time of the last command.
"""

import asyncio
import json
import math
import sys
import time

from lockstep.bench.harness.driving import applied_goals, drive_on
from lockstep.client import Console

__all__ = ["main"]

SWING_SECONDS = 4.0


async def drive(link: str, interval: float) -> None:
    async with Console(link, video=False, audio=False, name="driver") as console:
        await console.take_seat()
        axis = console.description.axes[0]
        middle, reach = axis.rest, min(axis.maximum - axis.rest, axis.rest - axis.minimum) / 4
        if axis.kind == "goal":
            goals = applied_goals(console)
            middle, reach = (goals[0] if goals else None) or 0.0, axis.reach / 4
        trips: list[float] = []
        told = time.monotonic()
        while True:
            began = time.monotonic()
            swing = math.sin(2 * math.pi * began / SWING_SECONDS)
            await drive_on(console, {axis.name: middle + reach * swing})
            trips.append(round((time.monotonic() - began) * 1000, 3))
            if began - told >= 1.0:
                print(json.dumps({"at": began, "event": console.stats().event, "trips_ms": trips}), flush=True)
                trips, told = [], began
            await asyncio.sleep(interval)


def main() -> None:
    asyncio.run(drive(sys.argv[1], float(sys.argv[2])))


if __name__ == "__main__":
    main()
