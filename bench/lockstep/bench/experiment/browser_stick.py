"""An operator at the page who holds the stick, and arms again as soon as the page permits it."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from playwright.async_api import Error

from lockstep.bench.browsers.chromium import open_page, running_chromium
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.browsers.pad import LEFT_Y, RB, START
from lockstep.bench.experiment.browser import robot_description
from lockstep.protocol.description import RobotDescription
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["BrowserStick", "browser_stick"]

RIGHT_X = 2
LOOK = 0.05  # s
ARMS_SECONDS = 1.0


class BrowserStick:
    """Drives in circles. A person takes longer than this to see that the page is back, and to press."""

    intentions: list[tuple[float, float]] = []  # the stick does not move, so they are all the same

    def __init__(self, page: ConsolePage) -> None:
        self._page = page

    async def run(self) -> None:
        """Drive until cancelled, or until the page is closed."""
        try:
            await self._hold()
        except Error:
            if not self._page.page.is_closed():
                raise

    async def _hold(self) -> None:
        while True:
            found = await self._page.stats()
            seat = found["seat"]
            if seat and seat["holder"] == "":
                await self._take_seat()
            elif seat and seat["mine"] and not found["armed"]:
                await self._arm()
                with contextlib.suppress(AssertionError):  # pressed again while it arms, START would disarm
                    await self._page.until("s.armed", ARMS_SECONDS)
            await asyncio.sleep(LOOK)

    async def _take_seat(self) -> None:
        """Take the seat, which the console frees when its operator falls silent; the page leaves that to the person."""
        button = self._page.page.get_by_role("button", name="Request control")
        if await button.is_visible():
            await button.click()

    async def _arm(self) -> None:
        """Arm, after the deadman was seen released."""
        await self._page.pad.press(RB, False)
        await self._page.pad.press(START)
        await self._page.pad.press(START, False)
        await self._page.pad.press(RB)
        await self._page.pad.tilt(LEFT_Y, -0.4)
        await self._page.pad.tilt(RIGHT_X, 0.6)


@asynccontextmanager
async def browser_stick(link: str) -> AsyncIterator[tuple[BrowserStick, RobotDescription]]:
    async with running_chromium() as browser, open_page(browser, link, pad=True) as page:
        stick = BrowserStick(ConsolePage(page))
        async with background_tasks(stick.run()):
            yield stick, await robot_description(link)
