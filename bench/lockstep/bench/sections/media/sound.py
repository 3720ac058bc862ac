"""Measures the time from the capture of sound at the bridge until it leaves a sound card, in Chromium.

The robot's microphone hears a tick twice a second, at known times of the machine's monotonic clock. A PulseAudio
server with a silent loudspeaker is the sound card; what it plays is recorded, and the ticks are found again. The
baseline is the same page in a Chromium without `AudioDecoder`, where the browser plays the track by its own rules.

Chromium itself needs time from a script's wish to the sound card. A page that begins a tone at once says how much.
"""

import asyncio
import shutil
from contextlib import AsyncExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import PAD, running_chromium
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.browsers.page_clock import read_page_clock
from lockstep.bench.browsers.sound_card import SoundCard, running_sound_card, tick_times
from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median, quantile
from lockstep.bench.harness.stack import running_stack
from lockstep.bench.harness.ticking_robot import TICK_PERIOD

__all__ = ["run"]

SECTION = "sound"
ROBOT = "lockstep.bench.harness.ticking_robot:TickingRobot"
SECONDS, QUICK_SECONDS = 20, 5
SETTLE = 4.0  # s for buffers to find their measure
MOST_DISCARDED = 1.0  # %
BROWSER = "the same page, played by Chromium (no AudioDecoder)"
NO_DECODER = "delete globalThis.AudioDecoder"
# A tone begins as soon as a script asks for it, with the page's own choice of blocks.
BARE = """async () => {
  const context = new AudioContext({ latencyHint: "interactive" });
  await context.resume();
  await new Promise((resolve) => setTimeout(resolve, 2000));
  window.asked = [];
  setInterval(() => {
    const tone = new OscillatorNode(context, { frequency: 2000 });
    tone.connect(context.destination);
    window.asked.push(performance.now());
    tone.start();
    tone.stop(context.currentTime + 0.01);
  }, 517);
}"""


class Spell(NamedTuple):
    delays: list[float]  # ms, from capture to the sound card
    expected: int  # ticks
    discarded: float  # % of segments


async def run(context: Context) -> list[Result]:
    if shutil.which("pulseaudio") is None or shutil.which("parec") is None:
        return [_missing("PulseAudio is not installed")]
    seconds = context.scale(SECONDS, QUICK_SECONDS)
    async with AsyncExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory(prefix="lockstep-sound-"))
        card = await stack.enter_async_context(running_sound_card(Path(folder)))
        bare = await _bare(card, seconds)
        ours = await _lockstep(card, seconds, own=True)
        theirs = await _lockstep(card, seconds, own=False)
    return _rows(bare, ours, theirs)


async def _bare(card: SoundCard, seconds: float) -> list[float]:
    """Return Chromium's own delays, in ms, from a script's wish to the sound card."""
    async with running_chromium(card.environment) as browser:
        page = await browser.new_page()
        await page.evaluate(BARE)
        clock = await read_page_clock(page)
        heard = tick_times(await card.listen(seconds))
        asked = [clock.monotonic(at) for at in await page.evaluate("window.asked")]
    before = [(time, [at for at in asked if at <= time]) for time in heard]
    return [(time - earlier[-1]) * 1000 for time, earlier in before if earlier]


async def _lockstep(card: SoundCard, seconds: float, own: bool) -> tuple[Spell, Spell]:
    """Measure with the operator watching, then driving."""
    async with running_stack(ROBOT) as stack, running_chromium(card.environment) as browser:
        console = await _open(browser, stack.operator, own)
        await console.until_live()
        await console.until("s.streams.microphone.rendered > 20")
        watching = await _spell(console, card, seconds)
        async with console.driving():
            return watching, await _spell(console, card, seconds)


async def _open(browser: Browser, link: str, own: bool) -> ConsolePage:
    context = await browser.new_context(viewport={"width": 1280, "height": 800})
    await context.add_init_script(path=PAD)
    if not own:
        await context.add_init_script(NO_DECODER)
    page = await context.new_page()
    await page.goto(link)
    return ConsolePage(page)


async def _spell(console: ConsolePage, card: SoundCard, seconds: float) -> Spell:
    await asyncio.sleep(SETTLE)
    before = await _sound(console)
    heard = tick_times(await card.listen(seconds))
    after = await _sound(console)
    received = after["received"] - before["received"]
    discarded = after["discarded"] - before["discarded"]
    return Spell(
        [time % TICK_PERIOD * 1000 for time in heard],
        int(seconds / TICK_PERIOD),
        100 * discarded / received if received else 100.0,
    )


async def _sound(console: ConsolePage) -> dict[str, Any]:
    found: dict[str, Any] = (await console.stats())["streams"]["microphone"]
    return found


def _missing(why: str) -> Result:
    return Result(section=SECTION, name="capture → sound card, median", value=None, unit="ms", conditions=why)


def _rows(bare: list[float], ours: tuple[Spell, Spell], theirs: tuple[Spell, Spell]) -> list[Result]:
    if not bare or not all(spell.delays for spell in (*ours, *theirs)):
        return [_missing("no tick was heard")]

    def row(name: str, value: float, baseline: float | None = None, **fields: Any) -> Result:
        return Result(
            section=SECTION,
            name=name,
            value=value,
            baseline=baseline,
            baseline_name="" if baseline is None else BROWSER,
            samples=len(ours[0].delays),
            conditions="planar robot with a ticking microphone, Opus, PulseAudio's null sink, headless Chromium",
            **{"unit": "ms", **fields},
        )

    rows: list[Result] = []
    for what, own, other in zip(("watching", "driving"), ours, theirs, strict=True):
        ticks = [100 * len(spell.delays) / spell.expected for spell in (own, other)]
        rows += [
            row(f"{what}, capture → sound card, median", median(own.delays), median(other.delays)),
            row(f"{what}, capture → sound card, p95", quantile(own.delays, 0.95), quantile(other.delays, 0.95)),
            row(f"{what}, discarded", own.discarded, other.discarded, unit="%", target=MOST_DISCARDED),
            row(f"{what}, ticks heard", ticks[0], ticks[1], unit="%"),
        ]
    chromium = median(bare)
    return [
        *rows,
        row("Chromium's own: script → sound card, median", chromium),
        row("watching, above Chromium's own, median", median(ours[0].delays) - chromium),
    ]
