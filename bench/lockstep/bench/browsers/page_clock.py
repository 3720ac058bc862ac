"""Relates a page's clock to this machine's monotonic clock."""

import time
from collections.abc import Sequence
from typing import NamedTuple

from playwright.async_api import Page

__all__ = ["PageClock", "clock_between", "read_page_clock"]

LOOKS = 40


class PageClock(NamedTuple):
    """Monotonic time = `offset` + the page's `performance.now()` in s, give or take `uncertainty`."""

    offset: float
    uncertainty: float

    def monotonic(self, milliseconds: float) -> float:
        return self.offset + milliseconds / 1000


def clock_between(looks: Sequence[tuple[float, float, float]]) -> PageClock:
    """Compute the clock from looks (monotonic before, page's clock, monotonic after), all in s.

    The page was read between the two. Each look bounds the offset from both sides; all together bound it more narrowly
    than any one.
    """
    latest = min(after - page for _, page, after in looks)
    earliest = max(before - page for before, page, _ in looks)
    return PageClock((earliest + latest) / 2, abs(latest - earliest) / 2)


async def read_page_clock(page: Page) -> PageClock:
    """Ask the page for its time repeatedly, and return its clock."""
    looks = []
    for _ in range(LOOKS):
        before = time.monotonic()
        now: float = await page.evaluate("performance.now()")
        looks.append((before, now / 1000, time.monotonic()))
    return clock_between(looks)
