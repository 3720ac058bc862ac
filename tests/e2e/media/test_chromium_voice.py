"""An operator's voice in real Chromium, from a fake microphone that plays a tone to what the robot's room hears."""

import asyncio
import wave
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.chromium import running_chromium
from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.sound_card import SoundCard, running_sound_card, tone_level
from tests.support.stack import Stack, running_stack

pytestmark = [pytest.mark.browser, pytest.mark.alone]

VOICE = 700.0  # Hz; the robot's own tone is another
HEARD, SILENT = 0.02, 0.001
PATIENCE = 30.0  # s


def write_tone(path: Path) -> Path:
    """Bursts, as speech has them: a browser takes an even tone for noise."""
    time = np.arange(48_000) / 48_000
    burst = np.sin(2 * np.pi * VOICE * time) * (np.sin(2 * np.pi * 3 * time) > -0.7)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(48_000)
        file.writeframes((burst * 15_000).astype("<i2").tobytes())
    return path


@asynccontextmanager
async def room(directory: Path) -> AsyncIterator[tuple[Stack, SoundCard]]:
    """A console whose loudspeaker is a sound card that can be listened to."""
    async with running_sound_card(directory) as card:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PULSE_SERVER", card.environment["PULSE_SERVER"])
            async with running_stack(directory, extra=("--speaker", "pulse:ears", "--quiet")) as stack:
                yield stack, card


@asynccontextmanager
async def speaking_chromium(directory: Path, *, allowed: bool = True) -> AsyncIterator[Browser]:
    """It plays its own sound to nowhere, so that only the voice is heard."""
    flags = [
        "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-audio-capture={write_tone(directory / 't.wav')}",
    ]
    if allowed:
        flags.append("--use-fake-ui-for-media-stream")
    async with running_chromium({"PULSE_SERVER": "unix:/nowhere"}, flags) as browser:
        yield browser


async def level(card: SoundCard, seconds: float = 1.0) -> float:
    return tone_level(await card.record(seconds), VOICE)


async def falls_silent(card: SoundCard) -> None:
    """When what was on its way, for longer on a busy machine, has been played, and from then on."""
    async with asyncio.timeout(PATIENCE):
        while await level(card, 0.3) >= SILENT:
            pass
    assert await level(card) < SILENT


async def talking(console: ConsolePage, held: bool) -> None:
    button = console.page.locator(".talk")
    await button.wait_for()
    box = await button.bounding_box()
    assert box is not None
    await console.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    if held:
        await console.page.mouse.down()
        await console.page.locator(".talk[data-talk=on]").wait_for()
    else:
        await console.page.mouse.up()
        await console.page.locator(".talk:not([data-talk=on])").wait_for()


async def test_the_holder_is_heard_while_the_button_is_held_and_everyone_sees_it(tmp_path: Path) -> None:
    async with (
        room(tmp_path) as (stack, card),
        speaking_chromium(tmp_path) as browser,
        open_console(browser, stack.operator) as console,
        open_console(browser, stack.observer, pad=False) as watcher,
    ):
        await console.until_live()
        await console.until("s.seat && s.seat.mine")
        await expect(watcher.page.locator(".talk")).to_be_hidden()
        assert await level(card) < SILENT
        await talking(console, True)
        await console.page.locator(".talk-label", has_text="You are heard").wait_for()
        await watcher.page.get_by_text("operator is speaking").wait_for()
        async with asyncio.timeout(PATIENCE):
            while await level(card) <= HEARD:
                pass
        await talking(console, False)
        await watcher.page.get_by_text("operator is speaking").wait_for(state="hidden")
        await falls_silent(card)


async def test_the_key_talks_too_and_silence_falls_when_the_seat_is_given_back_or_the_page_is_hidden(
    tmp_path: Path,
) -> None:
    async with (
        room(tmp_path) as (stack, card),
        speaking_chromium(tmp_path) as browser,
        open_console(browser, stack.operator) as console,
    ):
        await console.until_live()
        await console.until("s.seat && s.seat.mine")
        await console.page.keyboard.down("v")
        await console.page.locator(".talk-label", has_text="You are heard").wait_for()
        await console.page.get_by_role("button", name="Give control back").click()
        await console.until("s.seat && !s.seat.mine")
        await falls_silent(card)
        await console.page.keyboard.up("v")
        await console.page.get_by_role("button", name="Request control").click()
        await console.until("s.seat && s.seat.mine")
        await console.page.keyboard.down("v")
        await console.page.locator(".talk-label", has_text="You are heard").wait_for()
        other = await console.page.context.new_page()
        await other.bring_to_front()
        await console.page.evaluate("window.dispatchEvent(new Event('blur'))")  # headless windows keep the focus
        await console.page.locator(".talk:not([data-talk=on])").wait_for()
        await falls_silent(card)


async def test_a_microphone_that_is_refused_is_said_and_nothing_is_heard(tmp_path: Path) -> None:
    async with (
        room(tmp_path) as (stack, card),
        speaking_chromium(tmp_path, allowed=False) as browser,
        open_console(browser, stack.operator) as console,
    ):
        await console.page.context.clear_permissions()
        await console.until_live()
        await console.until("s.seat && s.seat.mine")
        await console.page.locator(".talk").dispatch_event("pointerdown", {"button": 0, "pointerId": 1})
        await console.page.get_by_text("The microphone was not allowed").wait_for()
        assert await level(card, 0.5) < SILENT
