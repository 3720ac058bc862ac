"""Pages through a soak: an operator's in Chromium, which keeps driving, and observers' in any browser, which watch."""

import asyncio
import time
from typing import Any, Protocol

from playwright.async_api import Error, Page

from lockstep.bench.browsers.firefox import Firefox
from lockstep.bench.harness.restarting_total import RestartingTotal
from lockstep.bench.soak.calm import Calm

__all__ = ["FirefoxDocument", "OperatorPage", "WatchedPage"]

LOOK_SECONDS = 0.25
PATIENCE = 30.0  # s of calm in which a page has to be live again without a reload
START, RB = 9, 5  # W3C standard mapping
LEFT_X, LEFT_Y = 0, 1
PRESS = "([button, pressed]) => window.testPad.press(button, pressed)"
TILT = "([axis, value]) => window.testPad.tilt(axis, value)"


class Document(Protocol):
    """A page of any browser."""

    async def evaluate(self, expression: str, /) -> Any: ...

    async def reload(self) -> Any: ...


class FirefoxDocument:
    """A page in Firefox."""

    def __init__(self, firefox: Firefox, link: str) -> None:
        self._firefox = firefox
        self._link = link

    async def evaluate(self, expression: str) -> Any:
        try:
            return await self._firefox.evaluate(expression)
        except RuntimeError as error:  # the page is between two documents
            raise Error(str(error)) from error

    async def reload(self) -> None:
        await self._firefox.open(self._link)


class WatchedPage:
    """Reads the page's statistics. If the page does not come back, it is reloaded, which is counted."""

    def __init__(self, document: Document, calm: Calm) -> None:
        self.reloads = 0
        self.statistics: dict[str, Any] | None = None  # the newest
        self.slowest_return = 0.0  # s of calm until it was live again
        self._document = document
        self._rendered, self._violations = RestartingTotal(), RestartingTotal()
        self._calm = calm
        self._live_at = time.monotonic()
        self._news = asyncio.Event()

    @property
    def rendered(self) -> int:
        """Pictures that were rendered, over all its connections."""
        return self._rendered.value

    @property
    def violations(self) -> int:
        """Pictures and sounds that were rendered outside the tolerance, over all its connections."""
        return self._violations.value

    async def run(self) -> None:
        """Watch the page until cancelled."""
        while True:
            await asyncio.sleep(LOOK_SECONDS)
            try:
                await self.look()
            except Error:
                continue  # the page is between two documents

    async def look(self) -> None:
        statistics: dict[str, Any] | None = await self._document.evaluate("window.lockstep?.stats() ?? null")
        if statistics is not None:
            self._count(statistics)
        now = time.monotonic()
        if statistics is not None and statistics["connected"] and self._shows_something_new(statistics):
            waited = min(now - self._live_at, self._calm.seconds())
            self.slowest_return = max(self.slowest_return, waited)
            self._live_at = now
            self._news.set()
        elif min(now - self._live_at, self._calm.seconds()) > PATIENCE:
            self.reloads += 1
            self._live_at = now
            await self._document.reload()
        self.statistics = statistics
        if statistics is not None:
            await self.act(statistics)

    async def until_live(self) -> None:
        """Wait until the page shows something new."""
        self._news.clear()
        await self._news.wait()

    async def act(self, statistics: dict[str, Any]) -> None:
        """Act as the page's user does in this state."""

    def _count(self, statistics: dict[str, Any]) -> None:
        self._violations.see(sum(each["violations"] for each in statistics["streams"].values()))
        self._rendered.see(_rendered(statistics))

    def _shows_something_new(self, statistics: dict[str, Any]) -> bool:
        """Return whether pictures advance, which needs everything to work."""
        shown = _rendered(statistics)
        return self.statistics is None or shown != _rendered(self.statistics)


class OperatorPage(WatchedPage):
    """A page whose user wants to drive: asks for the seat, arms and pushes the stick, whenever the page allows it."""

    arms = 0
    seat_requests = 0

    def __init__(self, page: Page, calm: Calm) -> None:
        super().__init__(page, calm)
        self.page = page

    async def act(self, statistics: dict[str, Any]) -> None:
        if not statistics["connected"] or statistics["stop"]["stopped"]:
            await self._let_go()
        elif not (statistics["seat"] and statistics["seat"]["mine"]):
            await self._let_go()
            await self._ask_for_the_seat()
        elif not statistics["armed"]:
            await self._let_go()
            await self.page.evaluate(PRESS, [START, True])
            await asyncio.sleep(0.08)  # a press is no shorter
            await self.page.evaluate(PRESS, [START, False])
            self.arms += 1
        else:
            await self.page.evaluate(PRESS, [RB, True])
            await self.page.evaluate(TILT, [LEFT_Y, -0.6])
            await self.page.evaluate(TILT, [LEFT_X, 0.4 if int(time.monotonic()) % 4 < 2 else -0.4])

    async def _let_go(self) -> None:
        await self.page.evaluate(PRESS, [RB, False])
        await self.page.evaluate(TILT, [LEFT_Y, 0])
        await self.page.evaluate(TILT, [LEFT_X, 0])

    async def _ask_for_the_seat(self) -> None:
        button = self.page.get_by_role("button", name="Request control").first
        if await button.is_visible() and await button.is_enabled():
            await button.click(timeout=1000)
            self.seat_requests += 1


def _rendered(statistics: dict[str, Any]) -> int:
    return sum(each["rendered"] for each in statistics["streams"].values() if each["kind"] == "video")
