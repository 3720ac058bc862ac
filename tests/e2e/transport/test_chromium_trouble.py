"""A page that does not get through says why, and what to do; what is only a help may fail."""

import re

import pytest
from playwright.async_api import Browser, Page, Route, expect

from lockstep.bench.browsers.console_page import open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

OFFERS = re.compile(r"/whep(\?|$)")
NOWHERE = "a=candidate:1 1 udp 2130706431 127.0.0.1 9 typ host\r\n"


async def _says(page: Page, title: str, hint: str) -> None:
    plate = page.locator(".plate")
    await expect(plate.locator(".plate-title")).to_have_text(title)
    await expect(plate).to_contain_text(hint)


async def test_each_way_not_to_get_through_has_its_own_words(own_stack: Stack, chromium: Browser) -> None:
    async def full(route: Route) -> None:
        body = {"error": "too_many_peers", "detail": "200 peers are connected"}
        await route.fulfill(status=503, json=body, headers={"Retry-After": "5"})

    async def no_robot(route: Route) -> None:
        await route.fulfill(status=503, json={"error": "robot_unreachable", "detail": "connection refused"})

    async with open_console(chromium, "about:blank") as console:
        page = console.page
        await page.route(OFFERS, full)
        await page.goto(own_stack.operator)
        await _says(page, "The console is full", "Somebody has to leave first")
        await page.unroute(OFFERS)
        await page.route(OFFERS, no_robot)
        await page.get_by_role("button", name="Try now").click()
        await _says(page, "Robot unreachable", "Connection refused.")
        await page.unroute(OFFERS)
        await page.route(OFFERS, lambda route: route.abort())
        await page.get_by_role("button", name="Try now").click()
        await _says(page, "Console unreachable", "Check your network")
        await page.unroute(OFFERS)
        await page.get_by_role("button", name="Try now").click()
        await console.until_live()
        await page.goto("about:blank")
        await page.goto(re.sub("token=.*", "token=not-a-token", own_stack.operator))
        await _says(page, "This link is not valid", "Open the newest link")
        await page.goto("about:blank")
        await page.goto(own_stack.console)
        await _says(page, "Open the link", "lockstep up printed")


async def test_blocked_udp_and_a_missing_relay_are_told_apart(own_stack: Stack, chromium: Browser) -> None:
    async def misled(route: Route) -> None:
        response = await route.fetch()
        answer = re.sub(r"a=candidate:.*\r\n", "", await response.text())
        await route.fulfill(response=response, body=answer.replace("a=end-of-candidates\r\n", NOWHERE))

    async with open_console(chromium, "about:blank") as blocked, open_console(chromium, "about:blank") as relayed:
        await blocked.page.route(OFFERS, misled)
        await blocked.page.goto(own_stack.operator)
        await relayed.page.goto(own_stack.observer + "&relay=only")
        await _says(blocked.page, "No path for pictures and commands", "A firewall blocks UDP")
        await _says(relayed.page, "No path through the TURN server", "Remove relay=only from the link")
        await blocked.page.unroute_all(behavior="ignoreErrors")


async def test_a_console_that_names_no_ice_servers_is_reached_directly(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, "about:blank") as console:
        await console.page.route("**/api/ice", lambda route: route.abort())
        await console.page.goto(stack.operator)
        await console.until_live()
