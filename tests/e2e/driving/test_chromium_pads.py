"""Gamepads in real Chromium: an unknown one is calibrated and drives; several; plugged and pulled."""

import json
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import FORWARD, LEFT_Y, RB, START
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

# Triggers are axes 2 and 5 that rest at -1 and read 0 until they are touched; axis 6 is a hat.
ODD: dict[str, Any] = {
    "id": "Odd pad (Vendor: 1234 Product: 5678)",
    "mapping": "",
    "axes": [0, 0, 0, 0, 0, 0, 23 / 7],
    "buttons": 13,
}
DEADMAN, ARM, STOP = 4, 6, 2


# A pad that reports at every look, as some wireless ones do, also while nothing changes. Counted are looks in a row:
# where a busy machine holds the page up, the row begins anew.
REPORTS = """() => {
  const pads = navigator.getGamepads.bind(navigator);
  let last = -Infinity;
  window.looks = 0;
  window.reports = true;
  navigator.getGamepads = () => {
    const now = performance.now();
    window.looks = now - last > 200 ? 0 : window.looks + 1;
    last = now;
    const [pad] = pads();
    if (window.reports) pad.timestamp += 4;
    return pads();
  };
}"""


class Hand:
    """A hand on one of the pads."""

    def __init__(self, console: ConsolePage, pad: int) -> None:
        self.console = console
        self.pad = pad

    async def hold(self, button: int, pressed: bool) -> None:
        await self.console.page.evaluate(
            "([at, down, pad]) => testPad.press(at, down, pad)", [button, pressed, self.pad]
        )

    async def tilt(self, axis: int, value: float) -> None:
        await self.console.page.evaluate("([axis, to, pad]) => testPad.tilt(axis, to, pad)", [axis, value, self.pad])

    async def press(self, button: int) -> None:
        await self.hold(button, True)
        await self.seen()
        await self.hold(button, False)

    async def move(self, axis: int, *places: float) -> None:
        for place in places:
            await self.tilt(axis, place)
            await self.seen()

    async def seen(self) -> None:
        """The page has read the pad since."""
        await self.console.page.evaluate("testPad.seen()")

    async def asked(self, words: str) -> None:
        await self.console.page.locator(".pad-ask", has_text=words).wait_for()


async def _plug(console: ConsolePage, **pad: Any) -> Hand:
    return Hand(console, await console.page.evaluate("(pad) => testPad.plug(pad)", pad))


async def _calibrate(console: ConsolePage, hand: Hand) -> None:
    page = console.page
    await page.keyboard.press("KeyG")
    await page.get_by_role("button", name="Calibrate Odd pad").click()
    for words, button in (("hold while driving", DEADMAN), ("that arms", ARM), ("stops the robot", STOP)):
        await hand.asked(words)
        await hand.press(button)
    for words, axis, first in (("left stick all the way right", 0, 1), ("left stick all the way up", 1, -1)):
        await hand.asked(words)
        await hand.move(axis, first, -first, 0)
    await hand.asked("right stick all the way right")
    await hand.move(3, 1, -1, 0)
    await hand.asked("right stick all the way up")
    await page.get_by_role("button", name="Skip").click()
    for words, axis in (("left trigger", 2), ("right trigger", 5)):
        await hand.asked(words)
        await hand.move(axis, 1, -1)
    await hand.asked("up on the cross")
    await hand.move(6, -1, 23 / 7)
    await page.locator(".pad-ask", has_text="up on the cross").wait_for(state="hidden")
    for _ in range(9):
        await page.get_by_role("button", name="Skip").click()
    await hand.asked("Try it")


async def test_a_pad_without_the_standard_mapping_is_calibrated_tried_and_drives(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator) as console:
        page = console.page
        await console.until_live()
        await page.evaluate("testPad.unplug()")
        hand = await _plug(console, **ODD)
        await console.until("s.pad && !s.pad.ready")
        await console.until("s.seat && s.seat.mine")
        await page.get_by_text("has to be calibrated first").wait_for()
        await _calibrate(console, hand)
        save = page.get_by_role("button", name="Save")
        await expect(save).to_be_disabled()
        await hand.press(DEADMAN)
        await hand.press(STOP)  # only tried: the robot is not stopped
        await hand.tilt(0, 1)
        await save.click()
        await console.until("s.pad.ready && s.pad.calibrated")
        assert not (await console.stats())["stop"]["stopped"]
        kept = json.loads(await page.evaluate("localStorage.getItem('lockstep.pads')"))
        (profile,) = kept["profiles"]
        assert profile["layout"]["triggers"]["left_trigger"] == {"kind": "axis", "index": 2, "rest": -1, "full": 1}
        assert profile["layout"]["cross"]["cross_up"] == {"kind": "hat", "index": 6, "value": -1}
        await hand.tilt(0, 0)
        await page.get_by_role("button", name="Close").click()
        # Armed with the deadman held it must not be; let go, it drives.
        await hand.hold(DEADMAN, True)
        await hand.press(ARM)
        await hand.seen()
        assert not (await console.stats())["armed"]
        await hand.hold(DEADMAN, False)
        await hand.seen()
        await hand.press(ARM)
        await console.until("s.armed")
        await hand.tilt(1, -1)
        await hand.hold(DEADMAN, True)
        await console.until("s.driving && s.at_rest === false")
        await hand.hold(DEADMAN, False)
        await console.until("!s.driving && s.at_rest === true")
        await hand.press(STOP)
        await console.until("s.stop.stopped && !s.armed")
        # It is known again after the page was loaded anew.
        await page.reload()
        await console.until_live()
        await page.evaluate("(pad) => { testPad.unplug(); testPad.plug(pad); }", ODD)
        await console.until("s.pad && s.pad.ready && s.pad.calibrated")


async def test_another_pad_cannot_take_over_but_can_stop(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        other = await _plug(console, id="Other pad")
        await console.arm()
        await other.tilt(LEFT_Y, -1)
        await other.hold(RB, True)
        await other.press(START)
        await other.seen()
        statistics = await console.stats()
        assert (statistics["armed"], statistics["driving"], statistics["at_rest"]) == (True, False, True)
        assert statistics["pad"]["id"].startswith("Test pad")
        await console.drive_forward()
        await other.press(1)
        await console.until("s.stop.stopped && !s.armed && s.at_rest === true")


async def test_a_pad_that_reported_all_the_time_and_falls_silent_while_it_is_held_disarms(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.page.evaluate(REPORTS)
        async with console.driving():
            # More than 200 ticks, with up to a dozen looks for each: a pad that reports the same again is there.
            await console.until("s.driving && window.looks > 3000", 60)
        await console.page.evaluate(
            "void (window.reports = false)"
        )  # out of range: stick and deadman stay as they were
        await console.until("!s.armed && s.at_rest === true")
        await console.page.get_by_text("the gamepad fell silent").first.wait_for()


async def test_a_pulled_pad_disarms_and_the_next_one_has_to_arm_anew(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        other = await _plug(console, id="Other pad")
        await other.tilt(LEFT_Y, -1)
        await other.hold(RB, True)
        await console.arm()
        await console.drive_forward()
        await console.page.evaluate("testPad.unplug(0)")
        await console.until("!s.armed && s.at_rest === true && s.pad.id === 'Other pad'")
        await other.press(START)
        assert not (await console.stats())["armed"]
        await other.hold(RB, False)
        await other.seen()
        await other.press(START)
        await console.until("s.armed && !s.driving")


async def test_turbo_drives_as_fast_as_the_limits_allow_and_the_settings_move_to_another_browser(
    stack: Stack, chromium: Browser, tmp_path: Path
) -> None:
    async with open_console(chromium, stack.operator) as console:
        page = console.page
        await console.until_live()
        await page.keyboard.press("KeyG")
        await page.get_by_label("Normal").fill("50")
        async with page.expect_download() as download:
            await page.get_by_role("button", name="Export").click()
        file = tmp_path / "pads.json"
        await (await download.value).save_as(file)
        await page.get_by_role("button", name="Close").click()
        await console.until("s.pad !== null")  # a press that was there before the pad is read again is no new one
        async with console.driving(FORWARD):
            event = (await console.stats())["event"]
            await console.until(f"s.event > {event + 8}", 40)
            await console.pad.press(10)
            await console.until(f"s.event > {event + 22}", 40)
        await console.pad.press(RB, False)
        await console.until("s.at_rest === true")
    fastest = [max(map(abs, record["values"])) for record in await stack.events("executed") if any(record["values"])]
    assert fastest[0] == pytest.approx(0.4)
    assert max(fastest) == pytest.approx(0.8)
    async with open_console(chromium, stack.observer) as console:
        page = console.page
        await console.until_live()
        await page.keyboard.press("KeyG")
        await page.locator("input[type=file]").set_input_files(file)
        await page.locator(".pad-row", has_text="Normal").get_by_text("50 %").wait_for()
        await page.locator("input[type=file]").set_input_files({"name": "x", "mimeType": "text/plain", "buffer": b"{"})
        await page.get_by_text("This file was not imported: the content is not JSON").wait_for()
