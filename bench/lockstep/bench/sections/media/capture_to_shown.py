"""Measures the time from the capture of a picture at the bridge to its drawing in Chromium.

The bridge logs the time of capture of each picture. A probe, put into the page from outside, notes the RTP timestamp
and the time of each drawing on the main camera's canvas; `bench.media_join` finds the captured picture, and
`bench.page_clock` puts both on one clock. Rendering at the robot and the way over TCP are part of the time.

A picture is "drawn" when the page has drawn it on its canvas, or a bare page has given it to the compositor
(requestVideoFrameCallback's presentationTime). It is "shown" when the browser has drawn the frame with it into its
window, as Chromium's trace tells (`bench.window_trace`). The baselines are that bare page on `bench.baseline_server`,
and pictures over WebSockets (`bench.rivals`), one after the other in the same run, at the same bridge, without an
operator.
"""

import asyncio
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

from playwright.async_api import Browser, Page

from lockstep.bench.browsers.chromium import PAD, running_chromium
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.browsers.pad import LEFT_Y, RB
from lockstep.bench.browsers.page_clock import PageClock, read_page_clock
from lockstep.bench.browsers.probed_page import DRAW_PROBE, open_probed_page
from lockstep.bench.browsers.window_trace import WindowTrace, traced_window
from lockstep.bench.context import Context
from lockstep.bench.figures.media_join import join_pictures
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.event_log import capture_times
from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import Bridge, Stack, running_stack
from lockstep.bench.robots.sixty_hertz import SIXTY_HERTZ_ROBOT

__all__ = ["AIORTC", "CAMERA", "bare_page", "driving_in_circles", "measured_spell", "run"]

SECTION = "capture_to_shown"
SECONDS, QUICK_SECONDS = 12.0, 4.0
SETTLE = 2.0  # s for the browser's buffers and the encoder to find their measure
LOG_DELAY = 0.3  # s until the bridge's log is on disk
LOG_ROUNDING = 1e-6  # s
CAMERA = "overview"  # 640x480 at 30 pictures a second
RIGHT_X = 2  # of the pad's axes
MEDIAN_MS, P95_MS = 40.0, 60.0
SIXTY_HERTZ_MS = 20.0
AIORTC = "plain aiortc: VideoStreamTrack encoded per peer, bare <video>, no playout-delay, nobody driving"
RIVALS = {
    "mjpeg": "MJPEG over a WebSocket, as ROS web_video_server sends it (JPEG quality 80), nobody driving",
    "foxglove": "the Foxglove SDK's WebSocket server, the same JPEGs as CompressedImage, nobody driving",
}
TAKE = "() => window.drawProbe.shown.splice(0)"


class Delays(NamedTuple):
    """Delays of the pictures shown in one spell, in ms."""

    drawn: list[float]
    shown: list[float]
    share: float  # of the pictures captured in the spell
    uncertainty: float  # ms, of the clocks
    megabits: float | None = None  # a second, of this camera's pictures; None: not measured
    codec: str = ""


async def run(context: Context) -> list[Result]:
    results: list[Result] = []
    for robot in context.robots[:1] if context.quick else context.robots:
        async with running_stack(robot) as stack:
            seconds = float(context.scale(int(SECONDS), int(QUICK_SECONDS)))
            idle, driving = await _lockstep(stack, seconds)
            baselines = {AIORTC: await bare_page(stack.bridge, seconds)}
            for kind, name in RIVALS.items():
                baselines[name] = await _rival(stack.bridge, kind, seconds)
            results += _compare(robot, idle, driving, baselines)
    return [*results, *await _sixty_hertz(context)]


async def _sixty_hertz(context: Context) -> list[Result]:
    """Measure a camera of 60 Hz, of the planar robot: its drawing leaves the machine the time for that."""
    async with running_stack(SIXTY_HERTZ_ROBOT) as stack:
        watching, driving = await _lockstep(stack, float(context.scale(int(SECONDS), int(QUICK_SECONDS))))
    results = []
    for name, found in (("driving", driving), ("watching", watching)):
        conditions = f"640×480 at 60 Hz, {watching.codec}; clocks agree within {found.uncertainty:.2f} ms"
        for what, value, target, unit in (
            ("shown, median", median(found.shown), SIXTY_HERTZ_MS, "ms"),
            ("shown, p95", quantile(found.shown, 0.95), None, "ms"),
            ("pictures shown", found.share * 100, None, "%"),
        ):
            results.append(
                Result(
                    section=SECTION,
                    name=f"planar at 60 Hz: {name}, {what}",
                    value=value,
                    unit=unit,
                    target=target,
                    samples=len(found.shown),
                    conditions=conditions,
                )
            )
    return results


async def _lockstep(stack: Stack, seconds: float) -> tuple[Delays, Delays]:
    """Measure with the operator watching, then driving."""
    async with running_chromium() as browser, open_probed_page(browser, stack.operator, PAD, DRAW_PROBE) as page:
        await page.evaluate("(stream) => { window.drawProbe.stream = stream; }", CAMERA)
        console = ConsolePage(page)
        await console.until_live()
        sent = await _sent(stack)
        began = time.monotonic()
        idle = await measured_spell(browser, page, stack.bridge, seconds)
        megabits = (await _sent(stack) - sent) * 8 / (time.monotonic() - began) / 1e6
        codec = (await console.stats())["streams"][CAMERA]["codec"]
        idle = idle._replace(megabits=megabits, codec=codec)
        async with driving_in_circles(console):
            return idle, await measured_spell(browser, page, stack.bridge, seconds)


async def _sent(stack: Stack) -> float:
    """Return the bytes of the camera's pictures sent to the only peer."""
    return sum((await stack.metrics()).values("lockstep_media_bytes_sent_total", "carrier", stream=CAMERA).values())


@asynccontextmanager
async def driving_in_circles(console: ConsolePage) -> AsyncIterator[None]:
    """Drive in circles with a held stick."""
    await console.arm()
    await console.pad.press(RB)
    await console.pad.tilt(LEFT_Y, -0.4)
    await console.pad.tilt(RIGHT_X, 0.6)
    await console.until("s.driving && s.at_rest === false")
    yield
    await console.pad.press(RB, False)


async def bare_page(bridge: Bridge, seconds: float) -> Delays:
    """Measure the page of plain aiortc at the same bridge."""
    command = (sys.executable, "-m", "lockstep.bench.baseline.baseline_server", bridge.address)
    async with (
        running_process(*command) as (_, ready),
        running_chromium() as browser,
        open_probed_page(browser, ready["console"]) as page,
    ):
        await page.wait_for_function("() => window.drawProbe?.shown.length > 3")
        return await measured_spell(browser, page, bridge, seconds)


async def _rival(bridge: Bridge, kind: str, seconds: float) -> Delays:
    command = (sys.executable, "-m", "lockstep.bench.rivals.picture_server", kind, bridge.address)
    async with (
        running_process(*command) as (_, ready),
        running_chromium() as browser,
        open_probed_page(browser, ready["console"]) as page,
    ):
        await page.wait_for_function("() => window.drawProbe?.shown.length > 3")
        await asyncio.sleep(SETTLE)
        clock = await read_page_clock(page)
        async with traced_window(browser) as traces:
            await page.evaluate(TAKE)
            bytes_before = await page.evaluate("window.drawProbe.bytes")
            await asyncio.sleep(seconds)
            pictures = await page.evaluate(TAKE)
            received = await page.evaluate("window.drawProbe.bytes") - bytes_before
    shown = _shown(pictures, clock, traces[0])
    await asyncio.sleep(LOG_DELAY)
    first, last = shown[0]["captured"], shown[-1]["captured"]
    spell = [time for time in capture_times(bridge.event_log, CAMERA) if first - LOG_ROUNDING <= time <= last]
    return Delays(
        drawn=[(clock.monotonic(entry["at"]) - entry["captured"]) * 1000 for entry in shown],
        shown=[(entry["shown"] - entry["captured"]) * 1000 for entry in shown],
        share=len(shown) / len(spell),
        uncertainty=clock.uncertainty * 1000,
        megabits=received * 8 / seconds / 1e6,
    )


async def measured_spell(browser: Browser, page: Page, bridge: Bridge, seconds: float) -> Delays:
    """Measure the pictures shown in `seconds`, after a short wait."""
    await asyncio.sleep(SETTLE)
    clock = await read_page_clock(page)
    async with traced_window(browser) as traces:
        await page.evaluate(TAKE)
        await asyncio.sleep(seconds)
        pictures = await page.evaluate(TAKE)
    await asyncio.sleep(LOG_DELAY)
    return _delays(_shown(pictures, clock, traces[0]), capture_times(bridge.event_log, CAMERA), clock)


def _shown(pictures: list[dict[str, Any]], clock: PageClock, trace: WindowTrace) -> list[dict[str, Any]]:
    """Return the pictures that reached the window, with the time when they did (s, monotonic)."""
    found = []
    for entry in pictures:
        if entry["surface"]:
            shown = trace.shown_by_surface(clock.monotonic(entry["at"]) - clock.uncertainty)
        elif entry["composed"] is not None:
            shown = trace.shown_by_page(clock.monotonic(entry["composed"]) - clock.uncertainty)
        else:
            continue
        if shown is not None:
            found.append({**entry, "shown": shown})
    return found


def _delays(shown: list[dict[str, Any]], captured: list[float], clock: PageClock) -> Delays:
    first, last = clock.monotonic(shown[0]["at"]), clock.monotonic(shown[-1]["at"])
    near = [time for time in captured if first - 5 < time < last]
    joined = join_pictures([entry["rtp"] for entry in shown], near)
    pairs = [(entry, time) for entry, time in zip(shown, joined.captured, strict=True) if time is not None]
    spell = [time for time in near if pairs[0][1] <= time <= pairs[-1][1]]
    return Delays(
        drawn=[(clock.monotonic(entry["at"]) - time) * 1000 for entry, time in pairs],
        shown=[(entry["shown"] - time) * 1000 for entry, time in pairs],
        share=len(pairs) / len(spell),
        uncertainty=clock.uncertainty * 1000,
    )


def _compare(robot: str, idle: Delays, driving: Delays, baselines: dict[str, Delays]) -> list[Result]:
    uncertainty = max(each.uncertainty for each in (idle, driving, *baselines.values()))
    conditions = (
        f"640×480 at 30 Hz, {idle.codec}, operator's page 1280×800 in headless Chromium, all cameras and sound on; "
        f"{robot}: clocks agree within {uncertainty:.2f} ms"
    )

    def row(name: str, value: float | None, baseline: float | None, against: str, **fields: Any) -> Result:
        return Result(
            section=SECTION,
            name=f"{robot}: {name}",
            value=value,
            baseline=baseline,
            baseline_name=against,
            samples=len(driving.drawn),
            conditions=conditions,
            **{"unit": "ms", **fields},
        )

    bare = baselines[AIORTC]
    rows = [
        row("driving, shown, median", median(driving.shown), median(bare.shown), AIORTC, target=MEDIAN_MS),
        row("driving, shown, p95", quantile(driving.shown, 0.95), quantile(bare.shown, 0.95), AIORTC, target=P95_MS),
        row("driving, drawn, median", median(driving.drawn), median(bare.drawn), AIORTC),
        row("driving, drawn, p95", quantile(driving.drawn, 0.95), quantile(bare.drawn, 0.95), AIORTC),
        row("driving, pictures shown", driving.share * 100, bare.share * 100, AIORTC, unit="%"),
    ]
    for name, rival in baselines.items():
        who = name.partition(",")[0].partition(":")[0]
        rows += [
            row(f"watching, shown, median, to {who}", median(idle.shown), median(rival.shown), name),
            row(f"watching, shown, p95, to {who}", quantile(idle.shown, 0.95), quantile(rival.shown, 0.95), name),
        ]
        if rival.megabits is not None:
            rows.append(row(f"bit rate, to {who}", idle.megabits, rival.megabits, name, unit="Mbit/s"))
    return rows
