"""The overview in Chromium behind one entry: two consoles, each with a simulated robot, that share a real Redis."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from pathlib import Path
from typing import NamedTuple

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Response, expect

from lockstep.bench.browsers.chromium import open_page
from lockstep.bench.harness.caddy import running_caddy
from lockstep.bench.harness.free_port import free_port
from tests.e2e.overview import in_view, stats, until
from tests.support.redis_server import RedisServer
from tests.support.stack import Stack, running_fleet
from tests.waiting import PATIENCE

pytestmark = pytest.mark.browser

SECRET = "one key for all consoles behind one entry"


class Consoles(NamedTuple):
    entry: str  # "http://localhost:PORT"
    redis: RedisServer
    one: Stack  # has "left"; the overview comes from it
    two: Stack  # has "crane"

    def link(self, role: str) -> str:
        """Of the first console, as somebody outside opens it."""
        given: str = getattr(self.one, role)
        return f"{self.entry}/#{given.partition('#')[2]}"


def _console(directory: Path, robot: str, port: int, settings: dict[str, str]) -> AbstractAsyncContextManager[Stack]:
    directory.mkdir()
    return running_fleet(directory, {robot: "planar"}, port=port, settings=settings)


@pytest_asyncio.fixture(loop_scope="session")
async def consoles(tmp_path: Path) -> AsyncIterator[Consoles]:
    port = free_port()
    entry = f"http://localhost:{port}"
    async with AsyncExitStack() as opened:
        redis = await opened.enter_async_context(RedisServer(tmp_path))
        settings = {
            "LOCKSTEP_BOARD": redis.url,
            "LOCKSTEP_SECRET": SECRET,
            "LOCKSTEP_PUBLIC_URL": entry,
            "LOCKSTEP_SCENE": "false",
        }
        ports = {"one": free_port(), "two": free_port()}
        started = [
            _console(tmp_path / name, robot, ports[name], {**settings, "LOCKSTEP_CONSOLE_NAME": name})
            for name, robot in (("one", "left"), ("two", "crane"))
        ]
        one, two = await asyncio.gather(*map(opened.enter_async_context, started))
        at_one, at_two = (f"127.0.0.1:{each}" for each in ports.values())
        await opened.enter_async_context(
            running_caddy("Caddyfile.fleet", tmp_path, port, tls=False, LOCKSTEP_ONE=at_one, LOCKSTEP_TWO=at_two)
        )
        yield Consoles(entry, redis, one, two)


def _is_stop_at_crane(response: Response) -> bool:
    return response.url.endswith("/robots/crane/api/stop") and response.request.method == "POST"


async def _stopped(console: Stack, robot: str) -> None:
    """Until the bridge's own log says so: its answer to another robot's stop says nothing of this one."""
    async with asyncio.timeout(PATIENCE):
        while not await console.events("stop", robot):  # noqa: ASYNC110
            await asyncio.sleep(0.05)


async def test_another_consoles_robot_is_seen_live_read_about_and_stopped_without_redis(
    consoles: Consoles, chromium: Browser
) -> None:
    async with open_page(chromium, consoles.link("supervisor")) as page:
        await until(page, "r.left.picture === 'live' && r.crane.picture === 'live'")
        shown = (await stats(page))["robots"]
        assert all(robot["rendered"] > 0 and robot["violations"] == 0 for robot in shown)

        await page.get_by_role("button", name="Audit trail").click()
        dialogue = page.get_by_role("dialog", name="Audit trail of all robots")
        rows = dialogue.get_by_role("row")
        await expect(rows.filter(has_text="crane").filter(has_text="link up")).not_to_have_count(0)
        await expect(rows.filter(has_text="left").filter(has_text="link up")).not_to_have_count(0)
        assert await in_view(page, "Stop all robots")

        consoles.redis.hang()
        try:
            async with page.expect_response(_is_stop_at_crane) as said:  # at that console itself
                await page.keyboard.press("Escape")
            assert (await said.value).status == 200
            for console, robot in ((consoles.one, "left"), (consoles.two, "crane")):
                await _stopped(console, robot)
            await until(page, "s.stop && s.stop.stopped.includes('left')")
            await expect(dialogue.get_by_role("status")).to_contain_text("Lines of other consoles may be missing")
        finally:
            consoles.redis.go_on()
        await expect(dialogue.get_by_role("status")).to_be_hidden()
        await dialogue.get_by_role("button", name="Stops").click()
        await expect(rows.filter(has_text="link up")).to_have_count(0)
        await expect(rows.filter(has_text="crane").filter(has_text="stop key")).not_to_have_count(0)
        await dialogue.get_by_role("button", name="Close").click()
        await expect(dialogue).to_have_count(0)
        await expect(page.get_by_role("article", name="crane")).to_contain_text("Stopped by")
        await page.get_by_role("link", name="Open to drive: crane").click()
        await page.wait_for_url(f"{consoles.entry}/robots/crane/#token=*")
