"""An observer sees the same session and cannot drive; several pages share one robot."""

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser


async def test_an_observer_sees_gated_pictures_and_has_no_way_to_arm(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.observer) as observer:
        await observer.until_live()
        await observer.until("s.role === 'observer'")
        await expect(observer.page.get_by_role("button", name="Arm", exact=True)).to_have_count(0)
        await observer.pad.press(9)
        await observer.until("s.streams.overview.rendered > 30")
        assert not (await observer.stats())["armed"]
    assert await stack.events("executed") == []


async def test_an_observer_follows_the_events_of_a_driving_operator_without_violation(
    stack: Stack, chromium: Browser
) -> None:
    async with (
        open_console(chromium, stack.operator) as operator,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        await operator.until_live()
        await observer.until_live()
        async with operator.driving():
            start = (await observer.stats())["event"]
            await observer.until(f"s.event > {start + 50} && s.streams.overview.rendered > 20", 60)
        streams = (await observer.stats())["streams"]
        assert [name for name, stream in streams.items() if stream["violations"]] == []


async def test_a_second_operator_is_told_who_drives_and_gets_the_seat_when_it_is_free(
    stack: Stack, chromium: Browser
) -> None:
    first_page = open_console(chromium, stack.operator)
    first = await first_page.__aenter__()
    await first.until("s.seat && s.seat.mine")
    async with open_console(chromium, stack.operator) as second:
        await second.until("s.connected && s.seat && s.seat.holder !== '' && !s.seat.mine")
        await first_page.__aexit__(None, None, None)
        await second.until("s.seat && s.seat.holder === ''")
        await second.page.get_by_role("button", name="Request control").click()
        await second.until("s.seat && s.seat.mine")


@pytest.mark.parametrize(("width", "height"), [(390, 844), (844, 390), (1280, 800)])
async def test_the_page_fits_its_screen_and_stop_is_in_view(
    stack: Stack, chromium: Browser, width: int, height: int
) -> None:
    async with open_console(chromium, stack.operator, width=width, height=height, touch=width < 1000) as console:
        await console.until_live()
        assert await console.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        box = await console.page.get_by_role("button", name="Stop the robot").bounding_box()
        assert box is not None
        assert box["width"] >= 60
        assert box["height"] >= 44
        assert 0 <= box["x"] <= width - box["width"]
        assert 0 <= box["y"] <= height - box["height"]


async def test_without_a_token_the_page_says_what_to_do(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.console, pad=False) as console:
        await console.page.get_by_text("link", exact=False).first.wait_for()
        assert not (await console.stats())["connected"] if await console.page.evaluate("'lockstep' in window") else True
