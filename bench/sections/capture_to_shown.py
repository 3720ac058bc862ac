"""From the capture of a picture at the bridge to its drawing in Chromium.

The bridge logs when it captured each picture. A probe, put into the page from outside, notes the RTP timestamp and
the time of each drawing on the main camera's canvas; `bench/media_join.py` tells which captured picture that is, and
`bench/page_clock.py` puts both on one clock. Rendering at the robot and the way over TCP are part of the time.

"Drawn" is when the page has drawn the picture on its canvas. "Shown" is when the browser then begins to compose a
frame, the same moment at which requestVideoFrameCallback tells a bare page about a picture of its <video>. The
baseline is that bare page on `bench/baseline_server.py`, in the same run, at the same bridge, with nobody driving.
"""

import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

from playwright.async_api import Page

from bench.browser import DRAW_PROBE, open_probed_page
from bench.context import Context
from bench.event_log import capture_times
from bench.media_join import join_pictures
from bench.page_clock import PageClock, read_page_clock
from bench.processes import running_process
from bench.results import Result
from bench.samples import median, quantile
from bench.stack import Bridge, Stack, running_stack
from tests.e2e.console_page import LEFT_Y, RB, ConsolePage
from tests.support.chromium import PAD, running_chromium

__all__ = ["run"]

SECTION = "capture_to_shown"
SECONDS, QUICK_SECONDS = 12.0, 4.0
SETTLE = 2.0  # s for the browser's buffers and the encoder to find their measure
LOG_DELAY = 0.3  # s until the bridge's log is on disk
CAMERA = "overview"  # 640x480 at 30 pictures a second
RIGHT_X = 2  # of the pad's axes
MEDIAN_MS, P95_MS = 40.0, 60.0
BARE = "plain aiortc: VideoStreamTrack encoded per peer, bare <video>, no playout-delay, nobody driving"
TAKE = "() => window.drawProbe.shown.splice(0)"


class Delays(NamedTuple):
    """Of the pictures shown in one spell, in ms."""

    drawn: list[float]
    shown: list[float]
    share: float  # of the pictures captured in the spell
    uncertainty: float  # ms, of the clocks


async def run(context: Context) -> list[Result]:
    results: list[Result] = []
    for robot in context.robots[:1] if context.quick else context.robots:
        async with running_stack(robot) as stack:
            seconds = float(context.scale(int(SECONDS), int(QUICK_SECONDS)))
            idle, driving = await _lockstep(stack, seconds)
            results += _compare(robot, idle, driving, await _bare(stack.bridge, seconds))
    return results


async def _lockstep(stack: Stack, seconds: float) -> tuple[Delays, Delays]:
    """With the operator watching, then driving."""
    async with running_chromium() as browser, open_probed_page(browser, stack.operator, PAD, DRAW_PROBE) as page:
        await page.evaluate("(stream) => { window.drawProbe.stream = stream; }", CAMERA)
        console = ConsolePage(page)
        await console.until_live()
        idle = await _spell(page, stack.bridge, seconds)
        async with _driving(console):
            return idle, await _spell(page, stack.bridge, seconds)


@asynccontextmanager
async def _driving(console: ConsolePage) -> AsyncIterator[None]:
    """Round and round with a held stick."""
    await console.arm()
    await console.press(RB)
    await console.tilt(LEFT_Y, -0.4)
    await console.tilt(RIGHT_X, 0.6)
    await console.until("s.driving && s.at_rest === false")
    yield
    await console.press(RB, False)


async def _bare(bridge: Bridge, seconds: float) -> Delays:
    command = (sys.executable, "-m", "bench.baseline_server", bridge.address)
    async with (
        running_process(*command) as (_, ready),
        running_chromium() as browser,
        open_probed_page(browser, ready["console"]) as page,
    ):
        await page.wait_for_function("() => window.drawProbe?.shown.length > 3")
        return await _spell(page, bridge, seconds)


async def _spell(page: Page, bridge: Bridge, seconds: float) -> Delays:
    """What is shown within `seconds` from soon on."""
    await asyncio.sleep(SETTLE)
    clock = await read_page_clock(page)
    await page.evaluate(TAKE)
    await asyncio.sleep(seconds)
    shown = [entry for entry in await page.evaluate(TAKE) if entry["composed"] is not None]
    await asyncio.sleep(LOG_DELAY)
    return _delays(shown, capture_times(bridge.event_log, CAMERA), clock)


def _delays(shown: list[dict[str, Any]], captured: list[float], clock: PageClock) -> Delays:
    first, last = clock.monotonic(shown[0]["at"]), clock.monotonic(shown[-1]["at"])
    near = [time for time in captured if first - 5 < time < last]
    joined = join_pictures([entry["rtp"] for entry in shown], near)
    pairs = [(entry, time) for entry, time in zip(shown, joined.captured, strict=True) if time is not None]
    spell = [time for time in near if pairs[0][1] <= time <= pairs[-1][1]]
    return Delays(
        drawn=[(clock.monotonic(entry["at"]) - time) * 1000 for entry, time in pairs],
        shown=[(clock.monotonic(entry["composed"]) - time) * 1000 for entry, time in pairs],
        share=len(pairs) / len(spell),
        uncertainty=clock.uncertainty * 1000,
    )


def _compare(robot: str, idle: Delays, driving: Delays, bare: Delays) -> list[Result]:
    conditions = (
        "640×480 at 30 Hz, VP8, operator's page 1280×800 in headless Chromium, all cameras and sound on; "
        f"{robot}: clocks agree within {max(idle.uncertainty, driving.uncertainty, bare.uncertainty):.2f} ms"
    )

    def row(
        name: str, value: float, target: float | None = None, baseline: float | None = None, unit: str = "ms"
    ) -> Result:
        return Result(
            section=SECTION,
            name=f"{robot}: {name}",
            value=value,
            unit=unit,
            target=target,
            baseline=baseline,
            baseline_name="" if baseline is None else BARE,
            samples=len(driving.drawn),
            conditions=conditions,
        )

    return [
        row("driving, shown, median", median(driving.shown), MEDIAN_MS, median(bare.shown)),
        row("driving, shown, p95", quantile(driving.shown, 0.95), P95_MS, quantile(bare.shown, 0.95)),
        row("driving, drawn, median", median(driving.drawn)),
        row("driving, drawn, p95", quantile(driving.drawn, 0.95)),
        row("watching, shown, median", median(idle.shown), None, median(bare.shown)),
        row("watching, shown, p95", quantile(idle.shown, 0.95), None, quantile(bare.shown, 0.95)),
        row("driving, pictures shown", driving.share * 100, None, bare.share * 100, "%"),
    ]
