"""A person who takes the control seat for a moment and gives it back."""

import asyncio
from contextlib import suppress

from lockstep.bench.harness.driving import axis_values, drive_on
from lockstep.client import Console
from lockstep.client.errors import CommandRefused, ConsoleError

__all__ = ["take_over"]

SECONDS = 3.0  # in the seat
PATIENCE = 20.0  # for connecting and taking the seat
BETWEEN = 0.05  # s between two commands


async def take_over(link: str) -> bool:
    """Take the seat by a supervisor's link, drive forwards, and leave. Return whether commands were executed."""
    driven = 0
    with suppress(ConsoleError, TimeoutError):
        async with asyncio.timeout(PATIENCE), Console(link, decode=False, name="relief") as console:
            await console.take_seat()
            values = axis_values(console.description.axes, {0: 0.3})
            end = asyncio.get_running_loop().time() + SECONDS
            while asyncio.get_running_loop().time() < end:
                with suppress(CommandRefused):
                    await drive_on(console, values)
                    driven += 1
                await asyncio.sleep(BETWEEN)
    return driven > 0
