"""`python -m lockstep.bench.three_networks.page LINK SECONDS`: a page that drives in circles; writes what it saw."""

import asyncio
import json
import sys
import time
from typing import Any

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.console_page import open_console

__all__ = ["drive"]

SETTLE = 5.0  # s in which the bitrate finds its measure


async def drive(link: str, seconds: float) -> dict[str, Any]:
    """Drive for `seconds`, and return what the page's own statistics say of them."""
    # The console signs its certificate itself, as one without a name has to.
    async with (
        running_chromium(flags=["--ignore-certificate-errors"]) as browser,
        open_console(browser, link) as page,
    ):
        await page.until_live()
        async with page.driving():
            await asyncio.sleep(SETTLE)
            before, began = await page.stats(), time.monotonic()
            await asyncio.sleep(seconds)
            after, passed = await page.stats(), time.monotonic() - began
        return {"before": before, "after": after, "seconds": passed}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asyncio.run(drive(sys.argv[1], float(sys.argv[2])))) + "\n")
