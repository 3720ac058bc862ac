"""Opens pages in Chromium with a measurement's scripts."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from playwright.async_api import Browser, Page

__all__ = ["DRAW_PROBE", "open_probed_page"]

DRAW_PROBE = Path(__file__).with_name("draw_probe.js")


@asynccontextmanager
async def open_probed_page(browser: Browser, link: str, *scripts: Path) -> AsyncIterator[Page]:
    """Open a page with nothing cached, after `scripts` ran in it."""
    context = await browser.new_context(viewport={"width": 1280, "height": 800})
    try:
        for script in scripts:
            await context.add_init_script(path=script)
        page = await context.new_page()
        await page.goto(link, wait_until="commit")
        yield page
    finally:
        await context.close()
