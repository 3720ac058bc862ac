"""Measures the time from opening the page to its first picture, each time in a new Chromium with an empty cache.

The time runs from the start of the navigation (the page's time origin) to the first picture that passed the gate and
was drawn. The baseline is a bare page on a plain aiortc server: one inline script, one video element.

Behind three networks the page is opened in network namespaces, with the kernel's own TCP; for root only.
"""

import math
import sys

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.probed_page import open_probed_page
from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median
from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import running_stack
from lockstep.bench.page_opening.far_openings import far_baseline, far_console, open_far
from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.impairment.profile import Profile, load_profile

__all__ = ["budget_ms", "run"]

SECTION = "first_picture"
OPENINGS, QUICK_OPENINGS = 7, 3
LIMIT_MS = 1000.0
FAR_PROFILES = ("hong-kong", "satellite", "narrow-uplink")
FAR_ROBOT = "planar"
FAR_OPENINGS = 5
LIMIT_BYTES = 60_000.0
BUDGET_ROUND_TRIPS, BUDGET_MS = 9, 400.0
TIMEOUT_MS = 20_000.0
OURS = "() => window.lockstep?.stats().first_picture_ms ?? 0"
THEIRS = "() => window.drawProbe?.firstMs ?? 0"
BARE = "plain aiortc and a bare page with one <video>"


async def run(context: Context) -> list[Result]:
    count = context.scale(OPENINGS, QUICK_OPENINGS)
    results: list[Result] = []
    for robot in context.robots[:1] if context.quick else context.robots:
        async with running_stack(robot) as stack:
            ours = [await _open(stack.operator, OURS) for _ in range(count)]
            command = (sys.executable, "-m", "lockstep.bench.baseline.baseline_server", stack.bridge.address)
            async with running_process(*command) as (_, ready):
                theirs = [await _open(ready["console"], THEIRS) for _ in range(count)]
        results += _rows(robot, ours, theirs)
    try:
        for profile in FAR_PROFILES:
            results += await _far(profile, context.scale(FAR_OPENINGS, 1))
    except NamespacesUnavailable as error:
        print(f"first_picture: not behind networks: {error}", file=sys.stderr)
    return results


def budget_ms(profile: Profile, asked: float) -> float:
    """Return the time in which a page that asks for so many bytes first has to show a picture, in ms.

    It is nine round trips, 0.4 s, and the bytes at the rate of the path. A round trip is the mean one of the path that
    takes longest of those that lead to the first picture; losses are not allowed for.
    """
    trips = [
        1000 * (two_way.to_operator.delay.mean + two_way.to_robot.delay.mean)
        for two_way in (profile.signalling, profile.control)
    ]
    bottleneck = profile.bottleneck_to_operator
    rate = bottleneck.rate if bottleneck is not None else math.inf
    return BUDGET_ROUND_TRIPS * max(trips) + BUDGET_MS + asked * 8 / rate * 1000


async def _far(profile: str, count: int) -> list[Result]:
    async with far_console(profile, FAR_ROBOT) as (network, link):
        ours = await open_far(network, link, OURS, count)
    async with far_baseline(profile, FAR_ROBOT) as (network, link):
        theirs = await open_far(network, link, THEIRS, count)

    found = load_profile(profile)
    limit = budget_ms(found, median([each["bytes"] for each in ours]))

    def row(name: str, unit: str, key: str, target: float) -> Result:
        return Result(
            section=SECTION,
            name=f"{FAR_ROBOT}, {profile}: {name}",
            value=median([each[key] for each in ours]),
            unit=unit,
            target=target,
            baseline=median([each[key] for each in theirs]),
            baseline_name=BARE,
            samples=len(ours),
            conditions=f"network {profile} between two network namespaces",
        )

    return [row("median", "ms", "first", limit), row("asked for before it", "bytes", "bytes", LIMIT_BYTES)]


async def _open(link: str, first_picture: str) -> float:
    """Open the page, and return the time in ms."""
    async with running_chromium() as browser, open_probed_page(browser, link) as page:
        found = await page.wait_for_function(first_picture, timeout=TIMEOUT_MS, polling=50)
        milliseconds: float = await found.json_value()
        return milliseconds


def _rows(robot: str, ours: list[float], theirs: list[float]) -> list[Result]:
    def row(name: str, value: float, baseline: float) -> Result:
        return Result(
            section=SECTION,
            name=f"{robot}: {name}",
            value=value,
            unit="ms",
            target=LIMIT_MS,
            baseline=baseline,
            baseline_name=BARE,
            samples=len(ours),
            conditions="operator's page, a new headless Chromium with an empty cache for each opening",
        )

    return [row("median", median(ours), median(theirs)), row("worst", max(ours), max(theirs))]
