"""What a page asks for until its first picture: in which order, and how much."""

import json
import re
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Page, Route

from lockstep.bench.browsers.console_page import open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

WINDOW = 14_600  # bytes: ten segments, what TCP sends before it hears anything (RFC 6928)
BUDGET = 60_000  # bytes of all that comes before the first picture

# What was asked for before the first picture, in order: name, when (ms), bytes with headers.
ASKED = """() => {
  const first = window.lockstep.stats().first_picture_ms;
  const entries = [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")];
  const before = entries.filter((each) => each.startTime < first && !each.name.startsWith("blob:"));
  before.sort((one, other) => one.startTime - other.startTime);
  return before.map((each) => [new URL(each.name).pathname, each.transferSize]);
}"""
SHOWN = "() => window.lockstep?.stats().first_picture_ms > 0"


async def _asked(page: Page) -> list[tuple[str, int]]:
    await page.wait_for_function(SHOWN, timeout=60_000)
    return [(name, size) for name, size in await page.evaluate(ASKED)]


async def _with_gzip(address: str, size: int) -> int:
    """What a file takes with gzip instead, and the same 300 bytes of headers; `size` of what is no file."""
    if address.endswith("/whep"):
        return size
    async with (
        httpx.AsyncClient(headers={"Accept-Encoding": "gzip"}) as http,
        http.stream("GET", address) as answer,
    ):
        assert answer.is_success
        return 300 + len(b"".join([part async for part in answer.aiter_raw()]))


async def test_before_the_first_picture_the_page_asks_for_sixty_kilobytes_and_the_offer_goes_first(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator) as console:
        asked = await _asked(console.page)
        names = [name for name, _ in asked]
        assert names[:2] == ["/", "/whep"]
        assert not [name for name in names if name.startswith("/api/")], "nothing has to be asked for first"
        assert sorted(re.sub(r"-[\w-]{8}\.", ".", name) for name in names[2:] if name != "/icon.svg") == [
            "/assets/index.css",
            "/assets/index.js",
            "/assets/shared.js",
        ]
        assert asked[0][1] < WINDOW
        assert sum(size for _, size in asked) < BUDGET, asked
        # Over plain HTTP from another machine browsers take no Brotli.
        assert sum([await _with_gzip(stack.console + name, size) for name, size in asked]) < BUDGET
        assert await console.page.evaluate("window.lockstepFirst === undefined"), "the page goes on with it"


async def test_whatever_the_rest_of_the_page_takes_the_gate_judges_with_feedback_that_came_meanwhile(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, "about:blank") as console:
        page = console.page

        async def hold(route: Route) -> None:
            # The connection is there, and has said a lot, before the script that listens.
            await page.wait_for_function(
                "() => window.lockstepFirst?.pending.early.filter((each) => each.channel === 'control').length > 3",
                timeout=60_000,
            )
            await route.continue_()

        await page.route(re.compile(r"/assets/index-.*\.js"), hold)
        await page.goto(stack.operator, wait_until="commit")
        await console.until_live()
        statistics = await console.stats()
        assert {name: each["violations"] for name, each in statistics["streams"].items()} == dict.fromkeys(
            statistics["streams"], 0
        )
        await page.unroute_all(behavior="ignoreErrors")


async def test_a_robot_with_more_cameras_than_most_shows_all_of_them(stack: Stack, chromium: Browser) -> None:
    refused: list[str] = []

    async def once_too_few(route: Route) -> None:
        if refused:
            await route.continue_()
            return
        refused.append(route.request.url)
        body = {"error": "too_few_sections", "detail": ""}
        await route.fulfill(status=409, content_type="application/problem+json", body=json.dumps(body))

    async with open_console(chromium, "about:blank") as console:
        await console.page.route(re.compile(r"/whep(\?|$)"), once_too_few)
        await console.page.goto(stack.operator)
        await console.until_live()
        assert len(refused) == 1
        assert "sections=all" in refused[0]
        await console.page.unroute_all(behavior="ignoreErrors")


async def test_what_comes_after_the_first_picture_is_tried_again_when_it_did_not_come(
    stack: Stack, chromium: Browser
) -> None:
    tries: list[Any] = []

    async def fail_once(route: Route) -> None:
        tries.append(route.request.url)
        await (route.abort() if len(tries) == 1 else route.continue_())

    async with open_console(chromium, "about:blank") as console:
        await console.page.route(re.compile(r"/assets/deferred_parts-.*\.js"), fail_once)
        await console.page.goto(stack.operator)
        await console.until_live()
        await console.page.locator(".stop").first.wait_for()
        await console.page.locator(".settings").wait_for(timeout=30_000)
        assert len(tries) > 1
        await console.page.unroute_all(behavior="ignoreErrors")
