"""An emulated headset on a page in Chromium: `iwer`, and what a test or a scripted operator does with it."""

import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from playwright.async_api import Browser, expect

from lockstep.bench.browsers import console_page
from lockstep.bench.browsers.console_page import ConsolePage, open_console

__all__ = ["HEADSET_SCRIPTS", "HELD_UP", "TRIES", "Headset", "open_headset"]

IWER = Path(__file__).parents[4] / "web" / "node_modules" / "iwer" / "build" / "iwer.min.js"  # of a checkout
EMULATED = Path(__file__).with_name("emulated_headset.js")
HEADSET_SCRIPTS = (IWER, EMULATED)

TRIES = 15  # the view must not stand still for 0.3 s meanwhile, where a processor draws it
SHOWN_MS = 30_000  # a page looks for a headset when a busy machine lets it
ARM_SECONDS, DRIVE_SECONDS = 2.0, 60.0  # for one squeeze to arm; for all of them to drive
HELD_UP = (*console_page.HELD_UP, "the headset stood still")
# Of the middles of the view's buttons from the operator's eyes, in m: to the right, up and ahead.
BUTTONS = {
    "stop": (0.76, -0.96, 1.42),
    "reset": (0.12, -1.3, 1.27),
    "leave": (-0.42, -1.3, 1.27),
    "recentre": (-0.8, -1.3, 1.27),
}

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
        await expect(button).to_be_visible(timeout=SHOWN_MS)
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

    async def aim(self, side: Side, button: str) -> None:
        """Turn the hand to a button of the view, also where it may not press that."""
        await self.page.evaluate("(at) => testHeadset.aim(...at)", [side, *BUTTONS[button]])

    async def point(self, side: Side, button: str) -> None:
        """Point at a button of the view from where the hand is."""
        await self.aim(side, button)
        await self.console.until(f"s.headset.pointed.{side} === {button!r}")

    async def holds(self, condition: str) -> bool:
        """Return whether a condition of `ConsolePage.until` is true now."""
        try:
            await self.console.until(condition, 0)
        except AssertionError:
            return False
        return True

    async def drive(self, side: Side = "right", ahead: float = 0) -> None:
        """Squeeze and tilt the sticks, to turn on the spot or go `ahead`, until the robot moves."""
        await self.tilt("left", 0, -ahead)
        await self.tilt("right", 0 if ahead else -1, 0)
        await self.drive_until("s.driving && s.at_rest === false", side)

    async def drive_until(self, condition: str, side: Side = "right") -> None:
        """Squeeze until `condition`; again if a busy machine ended that, each time a bit further on."""
        await self.console.until("s.seat && s.seat.mine")
        end = time.monotonic() + DRIVE_SECONDS
        while time.monotonic() < end:
            await self.squeeze(side, 0)
            await self.squeeze(side)
            with suppress(AssertionError):  # it may have been disarmed again before anybody looked
                await self.console.until("s.armed", ARM_SECONDS)
            await self.console.until(f"!s.armed || ({condition})", DRIVE_SECONDS)
            if await self.holds(condition):
                return
        raise AssertionError(f"it does not drive: {await self.console.stats()}")


@asynccontextmanager
async def open_headset(browser: Browser, link: str, *, width: int = 1024, height: int = 400) -> AsyncIterator[Headset]:
    """Open the console's page on a machine with a headset; each eye gets half of the window's width."""
    async with open_console(browser, link, width=width, height=height, scripts=HEADSET_SCRIPTS) as console:
        await console.until_live()
        yield Headset(console)
