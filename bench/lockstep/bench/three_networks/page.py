"""`python -m lockstep.bench.three_networks.page LINK SECONDS SETTLE`: a page that drives, and what it saw."""

import asyncio
import json
import sys
import time
from typing import Any

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.console_page import open_console

__all__ = ["drive"]


async def drive(link: str, seconds: float, settle: float) -> dict[str, Any]:
    """Drive for `settle` and then `seconds`; return what the page's own statistics say of the latter."""
    # The console signs its certificate itself, as one without a name has to.
    async with (
        running_chromium(flags=["--ignore-certificate-errors"]) as browser,
        open_console(browser, link) as page,
    ):
        await page.until_live()
        async with page.driving():
            await asyncio.sleep(settle)
            before, began = await page.stats(), time.monotonic()
            await asyncio.sleep(seconds)
            after, passed = await page.stats(), time.monotonic() - began
        return {"before": before, "after": after, "seconds": passed}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(asyncio.run(drive(sys.argv[1], *map(float, sys.argv[2:4])))) + "\n")
