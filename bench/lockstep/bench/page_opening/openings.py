"""Opens a page repeatedly, each time with nothing cached.

`python -m lockstep.bench.page_opening.openings LINK EXPRESSION COUNT`

It prints one JSON line for each opening: the time of the first picture by EXPRESSION, the times of the steps before it
(ms since the navigation began), and the number of bytes asked for until then.
"""

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.probed_page import open_probed_page

__all__ = ["main"]

PROBE = Path(__file__).with_name("opening_probe.js")
TIMEOUT_MS = 60_000.0
STEPS = """(first) => {
  const [page] = performance.getEntriesByType("navigation");
  const files = performance.getEntriesByType("resource").filter(({ startTime }) => startTime < first);
  const all = [page, ...files];
  const loaded = files.filter(({ name }) => /\\.(js|css)$/.test(name)).map(({ responseEnd }) => responseEnd);
  const steps = { document: page.responseEnd, "scripts and style": Math.max(0, ...loaded), ...window.openingSteps };
  return { first, steps, bytes: all.reduce((sum, { transferSize }) => sum + transferSize, 0), requests: all.length };
}"""


async def _open(link: str, expression: str) -> dict[str, Any]:
    async with running_chromium() as browser, open_probed_page(browser, link, PROBE) as page:
        found = await page.wait_for_function(expression, timeout=TIMEOUT_MS, polling=50)
        opened: dict[str, Any] = await page.evaluate(STEPS, await found.json_value())
        return opened


async def main() -> None:
    link, expression, count = sys.argv[1:]
    for _ in range(int(count)):
        print(json.dumps(await _open(link, expression)), flush=True)


if __name__ == "__main__":
    asyncio.run(main())
