"""`python -m lockstep.bench.three_networks.page LINK SETTLE [SECONDS]`: a page that drives, and what it saw.

Without SECONDS it drives until its standard input ends, and takes the stick again whenever the robot is back.
"""

import asyncio
import json
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import ROUND
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["drive"]


BACK = 120.0  # s that the robot may be away
MOST = 3600.0  # s


async def drive(link: str, settle: float, seconds: float | None = None) -> dict[str, Any]:
    """Drive for `settle` and then `seconds`; return what the page's own statistics say of the latter."""
    # The console signs its certificate itself, as one without a name has to.
    async with (
        running_chromium(flags=["--ignore-certificate-errors"]) as browser,
        open_console(browser, link) as page,
    ):
        await page.until_live()
        async with page.driving() if seconds is not None else _driving_again_and_again(page):
            await asyncio.sleep(settle)
            before, began = await page.stats(), time.monotonic()
            if seconds is None:
                await asyncio.to_thread(sys.stdin.read)
            else:
                await asyncio.sleep(seconds)
            after, passed = await page.stats(), time.monotonic() - began
        return {"before": before, "after": after, "seconds": passed}


@asynccontextmanager
async def _driving_again_and_again(page: ConsolePage) -> AsyncIterator[None]:
    """Drive inside the block as a person does who does not wait: arm as soon as the page shows the robot again."""
    await page.arm()
    await page.drive_forward(ROUND)
    async with background_tasks(_take_up_again(page)):
        yield


async def _take_up_again(page: ConsolePage) -> None:
    while True:
        await page.until("!s.armed", MOST)
        await page.pad.let_go()
        await page.until("s.connected && s.gate.state !== 'robot_down'", BACK)
        with suppress(AssertionError):  # away again
            await page.arm()
            await page.drive_forward(ROUND)


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asyncio.run(drive(sys.argv[1], *map(float, sys.argv[2:4])))) + "\n")
