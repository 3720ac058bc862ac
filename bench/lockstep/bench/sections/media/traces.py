"""Measures where each millisecond goes: the spans of a picture's and a command's way while the operator drives.

The page, the console and the bridge measure their own spans (docs/traces.md). The sum of a picture's spans is held
against the time from capture to drawing that a probe measures from outside on one clock, in the same spell, and against
plain aiortc in the same run. A picture's `between` needs no clock in common: it is what is left of the round from the
command to its picture.
"""

import asyncio
from typing import Any

from lockstep.bench.browsers.chromium import PAD, running_chromium
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.browsers.probed_page import DRAW_PROBE, open_probed_page
from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median
from lockstep.bench.figures.way_results import sum_of_spans, way_results
from lockstep.bench.harness.stack import Stack, running_stack
from lockstep.bench.sections.media.capture_to_shown import AIORTC, CAMERA, bare_page, driving_in_circles, measured_spell
from lockstep.protocol.traces.trace import COMMAND_WAY, PICTURE_WAY

__all__ = ["run"]

SECTION = "traces"
SECONDS, QUICK_SECONDS = 12.0, 4.0
PROBE = "the same pictures, by the bridge's log and a probe in the page, on one clock"
PAGE = "the same commands, from sending to feedback by the page's clock"
FROM_CAPTURE = tuple(span for span in PICTURE_WAY if span.name != "camera_wait_ms")
FROM_SENDING = tuple(span for span in COMMAND_WAY if span.name not in ("input_ms", "take_ms"))
CONDITIONS = "operator's page 1280×800 in headless Chromium, driving, all cameras and sound on, 640×480 at 30 Hz"


async def run(context: Context) -> list[Result]:
    results: list[Result] = []
    for robot in context.robots[:1] if context.quick else context.robots:
        async with running_stack(robot) as stack:
            seconds = float(context.scale(int(SECONDS), int(QUICK_SECONDS)))
            drawn, traced = await _driven(stack, seconds)
            bare = await bare_page(stack.bridge, seconds)
        results += _pictures(robot, traced["pictures"], drawn, bare.drawn)
        results += _commands(robot, traced["commands"])
    return results


async def _driven(stack: Stack, seconds: float) -> tuple[list[float], dict[str, list[dict[str, Any]]]]:
    """Return the delays from capture to drawing, in ms, and what was traced meanwhile."""
    async with running_chromium() as browser, open_probed_page(browser, stack.operator, PAD, DRAW_PROBE) as page:
        await page.evaluate("(stream) => { window.drawProbe.stream = stream; }", CAMERA)
        console = ConsolePage(page)
        await console.until_live()
        await page.evaluate("window.lockstep.trace(true)")
        async with driving_in_circles(console):
            began = await page.evaluate("performance.now()")
            delays = await measured_spell(browser, page, stack.bridge, seconds)
            await asyncio.sleep(0.5)  # what the console has still to tell
            traced = await page.evaluate("window.lockstep.traces()")
    return delays.drawn, {kind: [each for each in all_ if each["atMs"] >= began] for kind, all_ in traced.items()}


def _pictures(robot: str, traced: list[dict[str, Any]], drawn: list[float], bare: list[float]) -> list[Result]:
    whole = [each["spans"] for each in traced if each["stream"] == CAMERA and "between_ms" in each["spans"]]
    rows = way_results(SECTION, f"{robot}: picture", FROM_CAPTURE, whole, conditions=CONDITIONS)
    total = sum_of_spans(rows)
    return [
        *rows,
        _sum(f"{robot}: picture, sum, to the probe", total, len(whole), median(drawn), PROBE),
        _sum(f"{robot}: picture, sum, to plain aiortc", total, len(whole), median(bare), f"{AIORTC}; drawn"),
    ]


def _commands(robot: str, traced: list[dict[str, Any]]) -> list[Result]:
    spans = [each["spans"] for each in traced]
    rows = way_results(SECTION, f"{robot}: command", FROM_SENDING, spans, conditions=CONDITIONS)
    whole = median([each["totalMs"] for each in traced])
    return [*rows, _sum(f"{robot}: command, sum, to the page", sum_of_spans(rows), len(spans), whole, PAGE)]


def _sum(name: str, value: float, samples: int, baseline: float, baseline_name: str) -> Result:
    return Result(
        section=SECTION,
        name=name,
        value=value,
        unit="ms",
        baseline=baseline,
        baseline_name=baseline_name,
        samples=samples,
        conditions=CONDITIONS,
    )
