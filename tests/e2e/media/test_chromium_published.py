"""A camera that somebody publishes by WHIP, in real Chromium."""

import re
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from tests.server.media.published.publishing import TestPublisher
from tests.support.stack import running_stack

pytestmark = [pytest.mark.browser, pytest.mark.full_rate]


async def test_the_page_shows_a_published_camera_within_its_tolerance_and_says_when_nobody_publishes(
    tmp_path: Path, chromium: Browser
) -> None:
    async with (
        running_stack(tmp_path, extra=("--whip", "phone#label=Ann's phone,latency=0.1", "--quiet")) as stack,
        open_console(chromium, stack.observer) as console,
        httpx.AsyncClient(base_url=stack.console, trust_env=False, timeout=30) as http,
    ):
        view = console.page.locator("[data-view=phone]")
        await view.get_by_text("Nobody publishes", exact=True).wait_for()
        async with TestPublisher("H264") as publisher:
            token = {"Authorization": f"Bearer {stack.operator.partition('#token=')[2]}"}
            assert (await publisher.post(http, token)).status_code == 201
            await console.until("s.streams.phone.rendered > 20")
            await view.get_by_text("Nobody publishes").wait_for(state="hidden")
            stats = (await console.stats())["streams"]["phone"]
            assert (3 * stats["width"], stats["violations"]) == (4 * stats["height"], 0)
            assert stats["stamp"] >= 1
            await http.delete(publisher.location, headers=token)
            await view.get_by_text("Nobody publishes (its publisher has left)").wait_for()
        said = re.compile("^Ann's phone is (back, )?published by operator$")  # a busy machine may lose it for a moment
        await expect(console.page.get_by_text(said).first).to_be_attached()
