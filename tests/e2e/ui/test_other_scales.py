"""A robot of micrometres in the page that shows robots of metres."""

from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import open_console
from lockstep.bench.browsers.event_strip import drawn_event
from tests.support.stack import running_stack

pytestmark = [pytest.mark.browser, pytest.mark.full_rate]


async def test_the_page_is_in_micrometres_when_the_robot_is(tmp_path: Path, chromium: Browser) -> None:
    async with (
        running_stack(tmp_path, robot="micromanipulator", extra=("--event-strip",)) as stack,
        open_console(chromium, stack.operator) as console,
    ):
        await console.until_live()
        await expect(console.page.locator(".axis-value").first).to_have_text("0.0 µm/s")
        await expect(console.page.locator(".scale-words")).to_have_text("50 µm")
        await expect(console.page.get_by_label("Nearest obstacle")).to_be_hidden()
        for stream in ("microscope", "side"):
            read = await drawn_event(console.page, stream)
            assert read is not None
            assert read[1] in (None, read[0]), stream
        streams = (await console.stats())["streams"]
        assert {name: stream["violations"] for name, stream in streams.items()} == dict.fromkeys(streams, 0)
