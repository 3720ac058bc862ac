"""Measures the time from starting the program to the first picture in the operator's page.

`lockstep up` is started as a user starts it; as soon as it prints its links, a Chromium that is already running opens
the operator's. The baseline is the same with a bridge and a plain aiortc server, each in a separate process, and a bare
page.
"""

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.probed_page import open_probed_page
from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median
from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import running_bridge

__all__ = ["run"]

SECTION = "start"
STARTS, QUICK_STARTS = 5, 1
TIMEOUT_MS = 30_000.0
OURS = "() => (window.lockstep?.stats().first_picture_ms ?? 0) > 0"
THEIRS = "() => (window.drawProbe?.firstMs ?? 0) > 0"
BARE = "bridge and plain aiortc server started one after the other, bare page"


async def run(context: Context) -> list[Result]:
    count = context.scale(STARTS, QUICK_STARTS)
    results: list[Result] = []
    async with running_chromium() as browser:
        for robot in context.robots[:1] if context.quick else context.robots:
            ours = [await _lockstep(robot, browser) for _ in range(count)]
            theirs = [await _plain(robot, browser) for _ in range(count)]
            results += _rows(robot, ours, theirs)
    return results


async def _lockstep(robot: str, browser: Browser) -> tuple[float, float]:
    """Return the seconds to the links, and to the first picture."""
    lockstep = str(Path(sys.executable).with_name("lockstep"))
    with TemporaryDirectory(prefix="lockstep-bench-") as folder:
        began = time.monotonic()
        command = (lockstep, "up", "--robot", robot, "--port", "0", "--robot-port", "0", "--json", "--quiet")
        async with running_process(*command, environment={"LOCKSTEP_STATE_DIR": folder}) as (_, ready):
            linked = time.monotonic() - began
            return linked, await _first_picture(browser, ready["operator"], OURS, began)


async def _plain(robot: str, browser: Browser) -> tuple[float, float]:
    began = time.monotonic()
    async with (
        running_bridge(robot) as bridge,
        running_process(sys.executable, "-m", "lockstep.bench.baseline.baseline_server", bridge.address) as (_, ready),
    ):
        linked = time.monotonic() - began
        return linked, await _first_picture(browser, ready["console"], THEIRS, began)


async def _first_picture(browser: Browser, link: str, seen: str, began: float) -> float:
    async with open_probed_page(browser, link) as page:
        await page.wait_for_function(seen, timeout=TIMEOUT_MS, polling=20)
        return time.monotonic() - began


def _rows(robot: str, ours: list[tuple[float, float]], theirs: list[tuple[float, float]]) -> list[Result]:
    def row(name: str, which: int) -> Result:
        return Result(
            section=SECTION,
            name=f"{robot}: {name}, median",
            value=median([each[which] for each in ours]),
            unit="s",
            baseline=median([each[which] for each in theirs]),
            baseline_name=BARE,
            samples=len(ours),
            conditions="a Chromium that is already running, with an empty cache for each opening",
        )

    return [row("to the links", 0), row("to the first picture", 1)]
