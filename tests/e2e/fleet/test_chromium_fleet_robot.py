"""The page of one robot of a fleet, below /robots/NAME/: all that it does works there as it does at /."""

import re
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from tests.support.stack import running_fleet

pytestmark = pytest.mark.browser


async def test_a_robots_page_drives_shows_the_scene_invites_records_and_replays_and_moves_no_other(
    chromium: Browser, tmp_path: Path
) -> None:
    async with running_fleet(tmp_path, {"left": "planar", "right": "planar"}) as fleet:
        base, _, fragment = fleet.operator.partition("/#")
        asked: list[str] = []
        async with open_console(chromium, f"{base}/robots/left/#{fragment}") as console:
            page = console.page
            page.on("request", lambda request: asked.append(request.url))
            await console.until_live()
            record = page.locator(".record")
            await record.click()
            await expect(record).to_contain_text("Rec 0:")
            async with console.driving():
                await console.until("s.event > 8", 60)
            await record.click()
            await expect(record).to_have_text("Record")

            async with page.expect_event("websocket", timeout=60_000) as viewer:  # its drawing is tested elsewhere
                await console.open_full_scene()
            assert (await viewer.value).url.startswith(f"{base.replace('http', 'ws')}/robots/left/scene/ws/")

            await page.get_by_role("tab", name="People").click()
            await page.get_by_role("button", name="Invite…").click()
            dialogue = page.get_by_role("dialog")
            await dialogue.get_by_role("button", name="Create link").click()
            made = dialogue.get_by_role("textbox", name="Link")
            await expect(made).to_have_value(re.compile(f"^{re.escape(base)}/robots/left/#token="))
            link = await made.input_value()

            await page.goto(f"{base}/robots/left/recordings#{fragment}")
            await page.get_by_text("planar").first.wait_for()
            async with page.expect_download() as download:
                await page.get_by_role("button", name="Download").first.click()
            assert (await download.value).suggested_filename.endswith(".mcap")

            await page.goto(link)
            await console.until("s.connected && s.role === 'observer'")
        outside = {url for url in asked if not url.startswith((f"{base}/robots/left/", "blob:", "data:"))}
        assert outside == set()
        assert len(await fleet.events("executed", "left")) >= 7
        assert await fleet.events("executed", "right") == []
