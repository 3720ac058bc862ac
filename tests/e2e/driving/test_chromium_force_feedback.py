"""A joystick that pushes back: a fake behind a fake navigator.hid, with which Chromium's page drives into a wall."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from lockstep.bench.browsers.chromium import PAD
from lockstep.bench.browsers.console_page import SMALL_WINDOW, ConsolePage
from lockstep.bench.browsers.pad import FORWARD, RB, START, STOP_BUTTON
from tests.e2e.accessibility import findings
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.browser

STICK = Path(__file__).with_name("force_stick.js")
PLUGGED = "testPad.unplug(); testPad.plug({ id: 'Fake force stick (STANDARD GAMEPAD Vendor: 045e Product: 001b)' })"
PUSHES = "testStick.felt().ahead < -0.02"
HIDE = """(hidden) => {
  Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
  document.dispatchEvent(new Event("visibilitychange"));
}"""
ASKS = "navigator.hid.getDevices().then((devices) => devices.length, (error) => error.name)"


@asynccontextmanager
async def open_with_stick(browser: Browser, link: str) -> AsyncIterator[ConsolePage]:
    """A page whose only pad is the fake stick; its uncaught errors fail the test on leaving."""
    width, height = SMALL_WINDOW
    context = await browser.new_context(viewport={"width": width, "height": height})
    try:
        for script in (PAD, STICK):
            await context.add_init_script(path=script)
        page = await context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        await page.goto(link)
        console = ConsolePage(page)
        await console.until_live()
        await page.evaluate(PLUGGED)
        await console.until("s.pad && s.pad.ready")
        yield console
        assert not errors, "the page threw: " + "; ".join(errors)
        assert await page.evaluate("testStick.trouble") == []
    finally:
        await context.close()


async def _close_sheet(page: Page) -> None:
    await page.get_by_role("dialog").get_by_role("button", name="Close").click()


async def _choose(console: ConsolePage) -> None:
    page = console.page
    await page.keyboard.press("KeyG")
    section = page.get_by_role("region", name="Force feedback")
    await section.get_by_role("button", name="Choose a stick").click()
    await expect(section).to_contain_text("Fake force stick")
    await expect(section).to_contain_text("pushes while it drives")
    await _close_sheet(page)
    await expect(section).to_be_hidden()


async def _until_it_pushes(console: ConsolePage) -> None:
    async with console.driving(FORWARD):
        await console.until(PUSHES)


async def _is_free(console: ConsolePage) -> None:
    """The stick's last effect was ended, not only run out, and no other was begun."""
    await console.until("testStick.until === 0")
    sent = await console.page.evaluate("testStick.sent.length")
    await console.page.evaluate("new Promise((done) => setTimeout(done, 400))")
    assert await console.page.evaluate("testStick.sent.length") == sent


async def _let_go(console: ConsolePage) -> None:
    """Seen by the page, on a busy machine too: arming needs it."""
    await console.pad.press(RB, False)
    await console.until("!s.driving")


async def test_a_stick_is_chosen_pushes_back_at_a_wall_and_is_free_with_everything_that_ends_driving(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_with_stick(chromium, own_stack.operator) as console:
        page = console.page
        await _choose(console)
        await _until_it_pushes(console)
        hold = "testStick.sent.filter(([, id]) => id === 1).map(([, , bytes]) => bytes[2] + 256 * bytes[3])"
        durations = await page.evaluate(hold)
        assert durations
        assert max(durations) <= 300, "an effect of the planar robot's hold at most"
        # the deadman is let go
        await _let_go(console)
        await _is_free(console)
        await console.pad.press(START)
        await console.until("!s.armed")
        await console.pad.press(START, False)
        # disarmed
        await _until_it_pushes(console)
        await console.pad.press(START)
        await _is_free(console)
        await console.pad.press(START, False)
        await _let_go(console)
        # the page is hidden
        await _until_it_pushes(console)
        await page.evaluate(HIDE, True)
        await _is_free(console)
        await page.evaluate(HIDE, False)
        await _let_go(console)
        # STOP
        await _until_it_pushes(console)
        await console.pad.press(STOP_BUTTON)
        await _is_free(console)
        await console.pad.press(STOP_BUTTON, False)
        await _let_go(console)
        await console.until("s.stop.stopped")
        await console.reset()
        # the seat is given away
        await _until_it_pushes(console)
        await page.get_by_role("button", name="Give control back").click()
        await _is_free(console)
        await _let_go(console)
        await page.get_by_role("button", name="Request control").click()
        # the console is silent: feedback is old after the robot's hold
        await _until_it_pushes(console)
        with own_stack.frozen_console():
            await _is_free(console)
        await _let_go(console)
        await console.until("s.connected && s.seat && s.seat.mine", 40)
        # the stick is pulled
        await _until_it_pushes(console)
        await page.evaluate("navigator.hid.plug(false); testPad.unplug()")
        await console.until("!s.armed")
        await page.keyboard.press("KeyG")
        section = page.get_by_role("region", name="Force feedback")
        await expect(section).to_contain_text("The stick was unplugged")


async def test_the_settings_of_a_stick_hold_at_once_and_it_is_remembered(own_stack: Stack, chromium: Browser) -> None:
    async with open_with_stick(chromium, own_stack.operator) as console:
        page = console.page
        await _choose(console)
        await page.keyboard.press("KeyG")
        section = page.get_by_role("region", name="Force feedback")
        for name, share in (("Strongest force", "50"), ("Spring", "40"), ("Damper", "0")):
            await section.get_by_label(name).fill(share)
        assert await findings(page) == []
        await _close_sheet(page)
        async with console.driving(FORWARD):
            await console.until(PUSHES)
            await console.until("testStick.felt().spring > 0.35 && testStick.felt().damper === 0")
        await page.reload()
        await console.until_live()
        await page.evaluate(PLUGGED)
        await console.until("s.pad && s.pad.ready && testStick.opened")
        await page.keyboard.press("KeyG")
        await expect(section.get_by_label("Spring")).to_have_value("40")
        await section.get_by_role("button", name="Forget").click()
        await expect(section).to_contain_text("No stick")
        await console.until("!testStick.opened")


async def test_a_page_may_ask_for_devices_only_where_the_console_was_told_so(
    tmp_path: Path, stack: Stack, chromium: Browser
) -> None:
    page = await chromium.new_page()
    try:
        await page.goto(stack.console)
        assert await page.evaluate(ASKS) == "SecurityError"
        async with running_stack(tmp_path, settings={"LOCKSTEP_FORCE_FEEDBACK": "true"}) as allowing:
            await page.goto(allowing.console)
            assert await page.evaluate(ASKS) == 0
    finally:
        await page.close()
