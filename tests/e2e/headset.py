"""An emulated headset on a page in Chromium: `iwer`, and what a test does with it."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Literal

from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console

__all__ = ["Headset", "open_headset"]

HERE = Path(__file__).parent
IWER = HERE.parents[1] / "web" / "node_modules" / "iwer" / "build" / "iwer.min.js"
DRIVEN = HERE / "headset.js"

Side = Literal["left", "right"]
Mode = Literal["AR", "VR"]


class Headset:
    """The operator's hands and head. What is done is seen by the page before the call returns."""

    def __init__(self, console: ConsolePage) -> None:
        self.console = console
        self.page = console.page

    async def enter(self, mode: Mode = "VR") -> None:
        """Begin a session; from then on the window is silent and its document hidden, as in a headset."""
        button = self.page.get_by_role("button", name=f"Enter {mode}").first
        await expect(button).to_be_visible()
        await button.click()
        await self.console.until("s.headset && s.headset.frames > 3")
        await self.page.evaluate("testHeadset.silence(true)")

    async def leave(self) -> None:
        """The session ends, and the window goes on."""
        await self.page.evaluate("testHeadset.end()")
        await self.page.evaluate("testHeadset.silence(false)")
        await self.console.until("s.headset === null")

    async def press(self, side: Side, button: str, value: float = 1) -> None:
        await self.page.evaluate("(at) => testHeadset.press(...at)", [side, button, value])

    async def squeeze(self, side: Side = "right", value: float = 1) -> None:
        await self.press(side, "squeeze", value)

    async def tilt(self, side: Side, x: float, y: float) -> None:
        await self.page.evaluate("(at) => testHeadset.tilt(...at)", [side, x, y])

    async def place(self, side: Side, position: list[float], left: float = 0, up: float = 0) -> None:
        await self.page.evaluate("(at) => testHeadset.place(...at)", [side, position, left, up])

    async def look(self, left: float, up: float = 0) -> None:
        await self.page.evaluate("(at) => testHeadset.look(...at)", [left, up])

    async def do(self, script: str) -> Any:
        """Evaluate on `testHeadset` as `h`."""
        return await self.page.evaluate(f"(() => {{ const h = testHeadset; return {script}; }})()")

    async def drive(self, side: Side = "right") -> None:
        """Squeeze and push the left stick ahead until the robot moves."""
        await self.console.until("s.seat && s.seat.mine")
        await self.tilt("left", 0, -1)
        await self.squeeze(side)
        await self.console.until("s.driving && s.at_rest === false")


@asynccontextmanager
async def open_headset(browser: Browser, link: str, *, width: int = 1280, height: int = 640) -> AsyncIterator[Headset]:
    """Open the console's page on a machine with a headset; each eye gets half of the window's width."""
    async with open_console(browser, link, width=width, height=height, scripts=(IWER, DRIVEN)) as console:
        await console.until_live()
        yield Headset(console)
