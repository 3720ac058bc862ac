"""What comes out of the loudspeaker in real Chromium, recorded from the sound card."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import SMALL_WINDOW, ConsolePage, open_console
from lockstep.bench.browsers.sound_card import SoundCard, tone_level
from lockstep.client import Console
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.browser

TONE = 440.0  # Hz, what the planar robot plays
SILENT = 0.002
PATIENCE = 30.0  # s
TRIES = 12  # a busy machine may spoil some
# Its clock seems to go at half its speed while it takes short blocks.
SLOW_DEVICE = """
  const Real = AudioContext;
  window.opened = [];
  globalThis.AudioContext = class extends Real {
    constructor(options) {
      super(options);
      this.isShort = options.latencyHint === "interactive";
      window.opened.push(options.latencyHint);
    }
    get currentTime() { return super.currentTime / (this.isShort ? 2 : 1); }
  };
"""


async def test_the_robots_tone_is_heard(stack: Stack, loud_chromium: Browser, sound_card: SoundCard) -> None:
    async with open_console(loud_chromium, stack.operator) as console:
        await console.until_live()
        await console.until("s.streams.microphone.rendered > 20")
        assert await sound_card.hears(TONE, 0.04)


async def test_a_browser_without_a_decoder_for_scripts_plays_the_tone_itself(
    stack: Stack, loud_chromium: Browser, sound_card: SoundCard
) -> None:
    async with _prepared(loud_chromium, stack.operator, script="delete globalThis.AudioDecoder") as console:
        await console.until("s.streams.microphone.rendered > 20")
        assert await sound_card.hears(TONE, 0.04)


async def test_the_browser_plays_the_tone_where_the_worklet_cannot_be_loaded(
    stack: Stack, loud_chromium: Browser, sound_card: SoundCard
) -> None:
    async with _prepared(loud_chromium, stack.operator, missing="**/sound_worklet*") as console:
        await console.until("s.streams.microphone.rendered > 20")
        assert await sound_card.hears(TONE, 0.04)


async def test_a_sound_device_that_a_machine_does_not_keep_up_with_is_opened_again_with_longer_blocks(
    stack: Stack, loud_chromium: Browser, sound_card: SoundCard
) -> None:
    async with _prepared(loud_chromium, stack.operator, script=SLOW_DEVICE) as console:
        await console.until("window.opened.length === 2")
        assert await console.page.evaluate("window.opened") == ["interactive", 0.025]
        rendered = (await console.stats())["streams"]["microphone"]["rendered"]
        await console.until(f"s.streams.microphone.rendered > {rendered + 20}")
        assert await sound_card.hears(TONE, 0.04)


@asynccontextmanager
async def _prepared(browser: Browser, link: str, script: str = "", missing: str = "") -> AsyncIterator[ConsolePage]:
    """Open a page with a script before its own, and with files of it that cannot be had."""
    context = await browser.new_context(viewport={"width": SMALL_WINDOW[0], "height": SMALL_WINDOW[1]})
    try:
        await context.add_init_script(script)
        if missing:
            await context.route(missing, lambda route: route.abort())
        page = await context.new_page()
        await page.goto(link)
        console = ConsolePage(page)
        await console.until_live()
        yield console
    finally:
        await context.close()


async def test_one_of_a_crowd_hears_it_without_gaps_in_a_third_of_the_packets(
    tmp_path: Path, loud_chromium: Browser, sound_card: SoundCard
) -> None:
    crowd = {"LOCKSTEP_MEDIA__CROWD_OBSERVERS": "1"}
    async with (
        running_stack(tmp_path, settings=crowd) as stack,
        Console(stack.observer, decode=False),
        open_console(loud_chromium, stack.observer, pad=False) as console,
    ):
        await console.until_live()
        await console.until("s.streams.microphone.rendered > 20")
        assert await sound_card.hears(TONE, 0.04)
        for _ in range(TRIES):
            began = time.monotonic()
            before = (await console.stats())["streams"]["microphone"]
            heard = await sound_card.record(3.0)
            after = (await console.stats())["streams"]["microphone"]
            seconds = time.monotonic() - began
            levels = sorted(tone_level(part, TONE) for part in np.array_split(heard, 30))
            if levels[2] > 0.03:
                break
        assert levels[2] > 0.03, "each time with gaps in more than two tenths of a second"
        taken = after["received"] - before["received"]
        assert after["rendered"] - before["rendered"] > 0.9 * taken
        assert 3.0 / 0.06 - 5 < taken < seconds / 0.02 * 0.6  # at least those of three seconds; fewer than all


async def test_sound_outside_the_tolerance_is_silent_until_the_gate_is_switched_off(
    stack: Stack, loud_chromium: Browser, sound_card: SoundCard
) -> None:
    async with open_console(loud_chromium, stack.operator) as console:
        await console.until_live()
        await console.until("s.streams.microphone.rendered > 20")
        for _ in range(6):
            await console.page.get_by_role("button", name="Sound tolerance: one event less").click()
        await console.until("s.tolerance.audio === 0")
        async with console.driving():
            event = (await console.stats())["event"]
            await console.until(f"s.event > {event + 16}")
            gated = tone_level(await sound_card.record(1.0), TONE)  # sound takes longer than one event to arrive
        discarded = (await console.stats())["streams"]["microphone"]["discarded"]
        await console.page.get_by_role("switch", name="Media gate").click()
        await console.until("!s.gate_enabled")
        ungated = tone_level(await sound_card.record(1.0), TONE)
        assert discarded > 10
        assert gated < ungated / 2


async def test_a_dead_robot_link_is_silent(own_stack: Stack, loud_chromium: Browser, sound_card: SoundCard) -> None:
    async with open_console(loud_chromium, own_stack.operator) as console:
        await console.until_live()
        await console.until("s.streams.microphone.rendered > 20")
        with own_stack.frozen_bridge():
            await console.page.get_by_text("Robot unreachable").first.wait_for()
            async with asyncio.timeout(PATIENCE):  # what was on its way to the sound card, for long on a busy machine
                while tone_level(await sound_card.record(0.3), TONE) >= SILENT:
                    pass
            assert tone_level(await sound_card.record(1.0), TONE) < SILENT
