"""Opens the map on the page, and tells where on the page a place of it is."""

import re

from playwright.async_api import Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage

__all__ = ["open_map", "place_on_map"]

COVERED, COVERED_ON_A_PHONE = (0, 64), (104, 44)  # pixels at the upper and the lower edge


async def open_map(console: ConsolePage) -> Locator:
    """Open the map by its button; on a small screen that is in the details. Return its canvas."""
    buttons = console.page.get_by_role("button", name="Map", exact=True)
    shown = buttons.locator("visible=true")
    if await shown.count() == 0:
        await console.page.locator(".bar").get_by_role("button", name=re.compile("Details|More", re.I)).first.click()
    await shown.first.click()
    canvas = console.page.locator(".map-canvas")
    await expect(canvas).to_be_visible()
    await expect(console.page.locator(".map-facts")).to_contain_text("Map ")
    return canvas


async def place_on_map(canvas: Locator, x: float, y: float, size: tuple[float, float]) -> tuple[float, float]:
    """Return where a place, in m from the middle of a map of `size`, is on the page, while the whole map is seen."""
    box = await canvas.bounding_box()
    assert box is not None
    above, below = COVERED_ON_A_PHONE if box["width"] < 600 else COVERED
    height = box["height"] - above - below
    scale = 0.94 * min(box["width"] / size[0], height / size[1])
    return box["x"] + box["width"] / 2 + x * scale, box["y"] + above + height / 2 - y * scale
