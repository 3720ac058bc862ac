"""What the operator feels: the test pad's motors follow the planar robot's bumper, and stop with it."""

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import FORWARD, RB, START, STOP_BUTTON
from tests.support.stack import Stack

pytestmark = pytest.mark.browser


async def _feel_a_contact(console: ConsolePage) -> None:
    """Drive against a wall until the pad rumbles."""
    async with console.driving(FORWARD):
        await console.until("window.testPad.felt.at(-1) === 'dual-rumble'")


async def _let_go(console: ConsolePage) -> None:
    """Seen by the page, on a busy machine too: arming needs it."""
    await console.pad.press(RB, False)
    await console.until("!s.driving")


async def _is_still(console: ConsolePage) -> None:
    """The pad was told to stop, and nothing since."""
    await console.until("window.testPad.felt.at(-1) === null")
    played = await console.page.evaluate("testPad.rumbles.length")
    await console.page.evaluate("new Promise((done) => setTimeout(done, 400))")
    assert await console.page.evaluate("testPad.rumbles.length") == played


HIDE = """(hidden) => {
  Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
  document.dispatchEvent(new Event("visibilitychange"));
}"""


async def test_a_contact_is_felt_no_later_than_it_is_seen_and_rumble_ends_with_everything_that_ends_driving(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.operator) as console:
        page = console.page
        await console.until_live()
        await page.evaluate(
            "testPad.onplay = () => [lockstep.stats().event, lockstep.rendered('overview').at(-1).stamp]"
        )
        await _feel_a_contact(console)
        event, shown = await page.evaluate("testPad.rumbles[0].noted")
        assert event >= shown
        # let go and disarmed
        await _let_go(console)
        await console.pad.press(START)
        await console.until("!s.armed")
        await _is_still(console)
        await console.pad.press(START, False)
        # the page is hidden
        await _feel_a_contact(console)
        await page.evaluate(HIDE, True)
        await _is_still(console)
        await page.evaluate(HIDE, False)
        await _let_go(console)
        # STOP
        await _feel_a_contact(console)
        await console.pad.press(STOP_BUTTON)
        await _is_still(console)
        await console.pad.press(STOP_BUTTON, False)
        await _let_go(console)
        await console.until("s.stop.stopped")
        await console.reset()
        # the seat is given away
        await _feel_a_contact(console)
        await page.get_by_role("button", name="Give control back").click()
        await _is_still(console)
        await _let_go(console)
        await page.get_by_role("button", name="Request control").click()
        # the console is silent
        await _feel_a_contact(console)
        with own_stack.frozen_console():
            await _is_still(console)
        await _let_go(console)
        await console.until("s.connected && s.seat && s.seat.mine", 40)
        # the pad is pulled
        await _feel_a_contact(console)
        await page.evaluate("testPad.unplug()")
        await _is_still(console)


async def test_triggers_rumble_where_the_pad_has_motors_in_them_and_rumble_can_be_switched_off(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.operator) as console:
        page = console.page
        await console.until_live()
        await page.evaluate("testPad.unplug(); testPad.plug({ effects: ['dual-rumble', 'trigger-rumble'] })")
        await console.until("s.pad && s.pad.ready")
        async with console.driving(FORWARD):
            await console.until("window.testPad.felt.at(-1) === 'trigger-rumble'")
        effect = await page.evaluate("testPad.rumbles.at(-1)")
        assert effect["type"] == "trigger-rumble"
        assert 0 < effect["leftTrigger"] == effect["rightTrigger"] <= 1
        await page.get_by_role("switch", name="Rumble").click()
        await _is_still(console)
