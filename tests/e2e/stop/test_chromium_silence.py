"""A supervisor silences the STOP of a link that keeps pressing: what everybody sees, and how it ends."""

import pytest
from playwright.async_api import Browser, Locator

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser


def _row(console: ConsolePage, name: str) -> Locator:
    return console.page.get_by_role("listitem").filter(has_text=name)


async def test_a_silenced_page_is_told_and_its_stop_has_no_effect_until_the_supervisor_ends_it(
    stack: Stack, chromium: Browser
) -> None:
    async with (
        open_console(chromium, stack.supervisor + "&name=Sue", pad=False) as sue,
        open_console(chromium, stack.observer + "&name=Dee", pad=False) as dee,
    ):
        for page in (sue, dee):
            await page.until("s.connected && s.event !== null")
        await dee.page.keyboard.press("Escape")
        await dee.until("s.stop.stopped && s.stop_press === 'confirmed'")
        first = (await dee.stats())["stop"]["number"]

        await sue.page.get_by_role("tab", name="People").click()
        await _row(sue, "Dee").get_by_role("button", name="Silence STOP…").click()
        await _row(sue, "Dee").get_by_role("button", name="Silence", exact=True).click()
        await _row(sue, "Dee").get_by_text("STOP silenced", exact=True).wait_for()
        await dee.page.locator(".alarm").get_by_text("A supervisor silenced STOP from your link").wait_for()
        assert (await dee.stats())["stop"]["stopped"], "what was stopped before stays so"

        await dee.page.keyboard.press("Escape")
        await dee.until("s.stop_press === 'silenced'")
        await dee.page.locator(".alarm").get_by_text("Your STOP had no effect").wait_for()
        await dee.page.locator(".stop").get_by_text("HAD NO EFFECT").wait_for()
        await sue.reset()
        await dee.until("!s.stop.stopped")
        assert [each["number"] for each in await stack.events("stop")] == [first]

        await _row(sue, "Dee").get_by_role("button", name="Let STOP work again").click()
        await _row(sue, "Dee").get_by_text("STOP silenced", exact=True).wait_for(state="hidden")
        await dee.page.locator(".alarm").wait_for(state="hidden")
        await dee.page.keyboard.press("Escape")
        await dee.until("s.stop.stopped && s.stop_press === 'confirmed'")
        await sue.until("s.stop.stopped")
