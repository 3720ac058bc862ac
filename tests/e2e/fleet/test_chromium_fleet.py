"""The overview of a fleet in Chromium: three simulated robots of one console."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, expect

from lockstep.bench.browsers.chromium import open_page
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from tests.e2e.overview import in_view, stats, until
from tests.support.stack import Stack, running_fleet

pytestmark = pytest.mark.browser

NAMES = ("left", "middle", "right")


@pytest_asyncio.fixture(loop_scope="session")
async def fleet(tmp_path: Path) -> AsyncIterator[Stack]:
    async with running_fleet(tmp_path, dict.fromkeys(NAMES, "planar")) as running:
        yield running


@pytest_asyncio.fixture(loop_scope="session")
async def lone(tmp_path: Path) -> AsyncIterator[Stack]:
    """A fleet of one."""
    async with running_fleet(tmp_path, {"left": "planar"}) as running:
        yield running


async def _until_watched(page: Page, watching: dict[str, int], seconds: float = 30.0) -> None:
    """Until the console has so many live pictures open for these robots."""
    asking = """async ([wanted, limit]) => {
      const token = new URLSearchParams(location.hash.slice(1)).get("token");
      const end = performance.now() + limit;
      for (;;) {
        const answer = await fetch("api/fleet", { headers: { Authorization: `Bearer ${token}` } });
        const told = Object.fromEntries((await answer.json()).robots.map((robot) => [robot.name, robot.watching]));
        if (Object.entries(wanted).every(([name, count]) => told[name] === count)) return null;
        if (performance.now() > end) return JSON.stringify(told);
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
    }"""
    missed = await page.evaluate(asking, [watching, seconds * 1000])
    if missed is not None:
        raise AssertionError(f"never watched as {watching}, but {missed}")


@asynccontextmanager
async def _driving(fleet: Stack, robot: str) -> AsyncIterator[None]:
    """Somebody turns this robot on the spot inside the block."""

    async def turn(console: Console) -> None:
        while True:
            await drive_on(console, {"base.wz": 0.3})

    link = fleet.operator.replace("/#", f"/robots/{robot}/#")
    async with Console(link, video=False, audio=False, name="Ann") as console:
        await console.take_seat()
        turning = asyncio.create_task(turn(console))
        try:
            yield
        finally:
            turning.cancel()
            await asyncio.gather(turning, return_exceptions=True)


async def test_every_robot_has_a_live_tile_behind_its_gate_that_leads_to_its_page_and_back(
    fleet: Stack, chromium: Browser
) -> None:
    async with open_page(chromium, fleet.operator) as page:
        await until(page, f"s.robots.length === {len(NAMES)} && s.robots.every((x) => x.picture === 'live')")
        await expect(page.get_by_role("heading", level=2)).to_have_text(list(NAMES))
        await expect(page.get_by_role("article", name="middle")).to_contain_text("Free")
        async with _driving(fleet, "middle"):
            await until(page, "r.middle.state === 'driven' && r.middle.words === 'Driven by Ann'")
            await expect(page.get_by_role("article", name="left")).to_contain_text("Free")
            await until(page, "r.middle.stamp > 30 && r.left.stamp === 1")
        assert {robot["violations"] for robot in (await stats(page))["robots"]} == {0}
        await page.get_by_role("link", name="Open to drive: middle").click()
        await ConsolePage(page).until_live()
        assert "/robots/middle/#token=" in page.url
        assert await in_view(page, "Stop the robot")
        await page.get_by_role("link", name="All robots").click()
        await until(page, f"s.robots.length === {len(NAMES)}")
        assert page.url == fleet.operator


async def test_stop_all_says_which_robot_is_stopped_and_has_not_saved_that(
    fleet: Stack, chromium: Browser, tmp_path: Path
) -> None:
    (place,) = tmp_path.glob("**/stops/left")  # noqa: ASYNC240
    (place / "stop.new").mkdir()  # where the bridge writes its stop
    async with open_page(chromium, fleet.observer) as page:
        await until(page, "s.robots.length === 3 && s.robots.every((x) => x.state === 'free')")
        await page.get_by_role("button", name="STOP ALL").click()
        answer = page.get_by_role("alert")
        await expect(answer).to_contain_text("All 3 robots are stopped, 1 NOT SAVED")
        await expect(answer.get_by_role("listitem")).to_have_text(["left: stopped, but NOT SAVED on its disk"])
        await expect(answer).to_contain_text("may move again when it restarts")


async def test_a_robot_that_is_away_says_so_first_and_stop_reaches_the_others(fleet: Stack, chromium: Browser) -> None:
    async with open_page(chromium, fleet.observer) as page:
        await until(page, "s.open === 3 && s.robots.every((x) => x.picture === 'live')")
        with fleet.frozen_bridge("right"):
            await until(page, "r.right.state === 'unreachable' && !r.right.connected && r.right.picture !== 'live'")
            await until(page, "s.robots[0].name === 'right'")
            await expect(page.get_by_role("article", name="right")).to_contain_text("Unreachable since")
            await until(page, "r.left.picture === 'live' && r.middle.picture === 'live'")
            await page.get_by_role("searchbox").fill("left")
            await until(page, "s.robots.length === 1 && s.open === 1")
            await _until_watched(page, {"left": 1, "middle": 0})
            await page.keyboard.press("Escape")
            await until(page, "s.stop && s.stop.stopped.length === 2 && s.stop.tone === 'bad'")
            answer = page.get_by_role("alert")
            await expect(answer).to_contain_text("2 of 3 robots stopped")
            await expect(answer).to_contain_text("right: not delivered")
            await expect(answer).to_contain_text("emergency stops")
            for name in ("left", "middle"):
                assert await fleet.events("stop", name)
        await until(page, "s.stop && s.stop.tone === 'done' && s.stop.title === 'All 3 robots are stopped'")
        await page.get_by_role("button", name="Close").click()
        await page.get_by_role("searchbox").fill("")
        await expect(page.get_by_role("article", name="left")).to_contain_text("Stopped by")


async def test_a_lost_console_leaves_no_picture_that_looks_live(lone: Stack, chromium: Browser) -> None:
    async with open_page(chromium, lone.observer, width=390, height=844, touch=True) as page:
        await until(page, "s.robots.length === 1 && s.robots.some((x) => x.picture === 'live')")
        assert (await page.evaluate("document.documentElement.scrollWidth")) <= 390
        with lone.frozen_console():
            await until(page, "s.phase === 'unknown' && s.robots.every((x) => x.picture !== 'live')")
            await expect(page.get_by_role("article").first).to_contain_text("Unknown since")
            await expect(page.locator(".banner")).to_contain_text("This page shows the state at")
            await page.get_by_role("button", name="Stop all robots").tap()
            await expect(page.get_by_role("alert")).to_contain_text("stopped")
            assert await in_view(page, "Stop all robots")
        await until(page, "s.phase === 'live' && s.stop && s.stop.tone === 'done'")


async def test_a_link_that_is_no_good_says_what_to_do_and_can_be_replaced(lone: Stack, chromium: Browser) -> None:
    bad = re.sub("token=.*", "token=not-a-token", lone.observer)
    async with open_page(chromium, bad) as page:
        await expect(page.get_by_role("heading", name="This link is not valid")).to_be_visible()
        assert await in_view(page, "Stop all robots")
        await page.get_by_label("Your link").fill("hello")
        await page.get_by_role("button", name="Open").click()
        await expect(page.get_by_role("alert").first).to_contain_text("not a link of a console")
        await page.get_by_label("Your link").fill(lone.observer)
        async with page.expect_event("load"):
            await page.get_by_role("button", name="Open").click()
        await until(page, "s.robots.length === 1")
        await page.goto(lone.console)
        await expect(page.get_by_role("heading", name="Open the link")).to_be_visible()
