"""What the overview of a fleet shows, as a test asks for it."""

from typing import Any

from playwright.async_api import Page

from lockstep.bench.browsers.chromium import missed_in_page

__all__ = ["in_view", "stats", "until"]


async def until(page: Page, condition: str, seconds: float = 30.0) -> None:
    """Until `condition`, over `s`, the overview's figures, and `r`, its robots by name, is true."""
    waiting = """(limit) => new Promise((resolve) => {
      const holds = () => {
        try {
          const s = window.lockstepFleet.stats(), r = Object.fromEntries(s.robots.map((each) => [each.name, each]));
          return Boolean(%s);
        } catch { return false; }
      };
      const end = performance.now() + limit;
      const look = () => {
        if (holds()) resolve(null);
        else if (performance.now() > end) resolve(JSON.stringify(window.lockstepFleet?.stats() ?? null));
        else setTimeout(look, 20);
      };
      look();
    })"""
    missed = await missed_in_page(page, waiting % condition, seconds)
    if missed is not None:
        raise AssertionError(f"never came true: {condition}\nthe overview: {missed}")


async def stats(page: Page) -> dict[str, Any]:
    found: dict[str, Any] = await page.evaluate("window.lockstepFleet.stats()")
    return found


async def in_view(page: Page, name: str) -> bool:
    """Whether this button is, as a whole."""
    box = await page.get_by_role("button", name=name).bounding_box()
    size = page.viewport_size
    if box is None or size is None:
        return False
    return box["x"] >= 0 and box["x"] + box["width"] <= size["width"] and box["y"] + box["height"] <= size["height"]
