"""Whose the keyboard is: the robot's after a pointer's click, the page's for who moves the focus with Tab."""

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

TRIES = 3  # a busy machine may hold up the robot or the page, which disarms it


async def test_after_a_click_of_a_button_enter_arms_and_the_space_bar_drives(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        keyboard = console.page.keyboard
        await console.until("s.seat && s.seat.mine")
        media = console.page.get_by_role("button", name="Media")
        await media.click()
        await console.until("s.pacing === 'media'")
        for _ in range(TRIES):
            await console.arm_by_key()
            await keyboard.down("KeyW")
            await keyboard.down("Space")
            await console.until("!s.armed || (s.driving && s.at_rest === false)")
            drives = (await console.stats())["driving"]
            await keyboard.up("Space")
            await console.until("!s.driving && s.at_rest === true")
            await keyboard.up("KeyW")
            if drives:
                break
        else:
            raise AssertionError("the space bar does not drive")
        assert (await console.stats())["pacing"] == "media"
        # A dialogue gives the focus back to the button that opened it.
        await console.page.get_by_role("button", name="Keys").click()
        await console.page.get_by_role("dialog").get_by_role("button", name="Close").click()
        await console.until("!s.armed")
        await console.arm_by_key()


async def test_who_moves_the_focus_with_tab_works_the_page_and_is_told_so(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        await console.until("s.seat && s.seat.mine")
        await console.page.get_by_role("button", name="Media").focus()
        await console.page.get_by_text("Enter and Space work “Media” now").wait_for()
        await console.page.keyboard.press("Enter")
        await console.until("s.pacing === 'media'")
        assert not (await console.stats())["armed"]
        await console.page.get_by_role("button", name="Arm", exact=True).focus()
        await console.arm_by_key()
