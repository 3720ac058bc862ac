"""Handles the page as its user does, and reads its statistics, for tests in Chromium."""

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from playwright.async_api import Browser, Error, Page

from lockstep.bench.browsers.chromium import missed_in_page, open_page
from lockstep.bench.browsers.pad import FORWARD, LEFT_Y, RB, ROUND, START, Pad
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["SMALL_WINDOW", "ConsolePage", "open_console"]

# The smallest size that shows all of the page at once: where the processor draws, each pixel of the window costs.
SMALL_WINDOW = (1024, 640)
ARM_TRIES, ARM_SECONDS = 3, 5.0
# The page's reasons for disarming after a busy machine held up the robot, the console or the page.
HELD_UP = (
    "the robot interrupted the motion",
    "the connection was lost",
    "the robot cannot be reached",
    "the control seat was lost",
    "not connected to the console",
    "get the control seat first",
)
HOLD_SECONDS, RESET_SECONDS = 10.0, 60.0  # for one hold of the button to take effect; for all holds

# The hook is in the code that the page loads after its first picture.
STATISTICS = """new Promise((resolve) => {
  const look = () => (window.lockstep ? resolve(window.lockstep.stats()) : setTimeout(look, 20));
  look();
})"""


class ConsolePage:
    """One open page. Each wait is for something that the page reports, never for time to pass.

    Attributes:
        pad: the gamepad that it has, if it was opened with one
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.pad = Pad(page)

    async def stats(self) -> dict[str, Any]:
        """Return `window.lockstep.stats()`, as soon as it is there."""
        statistics: dict[str, Any] = await self.page.evaluate(STATISTICS)
        return statistics

    async def until(self, condition: str, seconds: float = 40.0) -> None:
        """Wait until `condition`, an expression over `s`, the page's statistics, is true; one that throws is not."""
        missed = await self._missed(condition, seconds)
        if missed is not None:
            shown = " | ".join((await self.page.inner_text("body")).split("\n"))
            raise AssertionError(f"never came true: {condition}\nthe page's statistics: {missed}\nthe page: {shown}")

    async def _missed(self, condition: str, seconds: float) -> str | None:
        """Return the page's statistics at the end if the condition did not come true; else None."""
        holds = f"const s = window.lockstep?.stats(); return Boolean(s && ({condition}));"
        # The condition is part of the script: the page's content security policy forbids evaluating strings.
        waiting = """(limit) => new Promise((resolve) => {
          const holds = () => { try { %s } catch { return false; } };
          const end = performance.now() + limit;
          const look = () => {
            if (holds()) resolve(null);
            else if (performance.now() > end) resolve(JSON.stringify(window.lockstep?.stats() ?? null));
            else setTimeout(look, 20);
          };
          look();
        })"""
        return await missed_in_page(self.page, waiting % holds, seconds)

    async def until_live(self) -> None:
        """Wait until the page is connected and has drawn every picture stream a few times."""
        videos = "Object.values(s.streams).filter((x) => x.kind === 'video')"
        # A machine that is starting other programs may leave a browser without a turn for half a minute.
        await self.until(f"s.connected && {videos}.length > 0 && {videos}.every((x) => x.rendered > 3)", 45)

    async def arm(self) -> None:
        """Press the pad's START, as an operator does: let go and press again if nothing happens."""
        await self.until("s.seat && s.seat.mine")
        for _ in range(ARM_TRIES - 1):
            await self.pad.press(START)
            missed = await self._missed("s.armed", ARM_SECONDS)
            await self.pad.press(START, False)
            if missed is None:
                return
        await self.pad.press(START)
        await self.until("s.armed", 20)
        await self.pad.press(START, False)

    async def arm_by_key(self) -> None:
        """Press Enter where the keyboard is the robot's; again if nothing happens."""
        await self.until("s.seat && s.seat.mine")
        for _ in range(ARM_TRIES - 1):
            await self.page.keyboard.press("Enter")
            if await self._missed("s.armed", ARM_SECONDS) is None:
                return
        await self.page.keyboard.press("Enter")
        await self.until("s.armed", 20)

    async def drive_forward(self, tilts: Mapping[int, float] = FORWARD) -> None:
        """Hold the deadman and tilt the sticks; arm again if a busy machine ended that."""
        for _ in range(ARM_TRIES):
            await self.pad.press(RB)
            for axis, value in tilts.items():
                await self.pad.tilt(axis, value)
            await self.until("!s.armed || (s.driving && s.at_rest === false)")
            if not await self.was_held_up():
                break
            await self._arm_anew(tilts)
        await self.until("s.driving && s.at_rest === false", 20)

    @asynccontextmanager
    async def driving(self, tilts: Mapping[int, float] = ROUND) -> AsyncIterator[None]:
        """Arm and drive inside the block, again if a busy machine ended that; deadman and sticks stay held.

        Anything else that ends it, such as a stop, lasts.

        Raises:
            ExceptionGroup: the page failed meanwhile; the block was cancelled.
        """
        await self.arm()
        await self.drive_forward(tilts)
        async with background_tasks(self._go_on(tilts)):
            yield

    async def _go_on(self, tilts: Mapping[int, float]) -> None:
        try:
            while True:
                await self._missed("!s.armed", 600)
                if not await self.was_held_up():
                    return
                with suppress(AssertionError):  # held up again; the block's own waits tell of anything else
                    await self._arm_anew(tilts)
                    await self.drive_forward(tilts)
        except Error:
            if not self.page.is_closed():
                raise

    async def _arm_anew(self, tilts: Mapping[int, float]) -> None:
        await self.pad.press(RB, False)
        for axis in tilts:
            await self.pad.tilt(axis, 0)
        await self.until("s.connected")
        await self.arm()

    async def was_held_up(self) -> bool:
        """Return whether the page is disarmed because this machine held something up."""
        if await self._missed("!s.armed", 0) is not None:
            return False
        await self._missed("document.querySelector('.arm').dataset.state === 'disarmed'", 5)  # it is drawn later
        words = await self.page.locator(".arm-words").text_content() or ""
        return any(why in words.casefold() for why in HELD_UP)

    async def drive_on_until(self, condition: str, seconds: float = 60.0) -> None:
        """Arm and drive forward until `condition`; again whenever the page has disarmed, as a bad network makes it."""
        async with asyncio.timeout(seconds):
            while True:
                await self.arm()
                await self.pad.press(RB)
                await self.pad.tilt(LEFT_Y, -1)
                await self.until(f"!s.armed || ({condition})", seconds)
                if await self._missed(condition, 0) is None:
                    return
                await self.pad.let_go()

    async def open_full_scene(self) -> None:
        """Open the 3D scene as the large view; ask for it first if it is not shown."""
        shown = self.page.get_by_role("button", name="3D scene", exact=True)
        if await shown.get_attribute("aria-pressed") == "false":
            await shown.click()
        await self.page.get_by_role("button", name="Show 3D scene large").click()

    async def reset(self) -> None:
        """Hold the button until the robot says that it is no longer stopped; again if it slipped away."""
        button = self.page.get_by_role("button", name="Hold to reset")
        async with asyncio.timeout(RESET_SECONDS):
            while await self._missed("!s.stop.stopped", 0) is not None:
                await button.hover()
                await self.page.mouse.down()
                await self._missed("!s.stop.stopped", HOLD_SECONDS)
                await self.page.mouse.up()


@asynccontextmanager
async def open_console(
    browser: Browser,
    link: str,
    *,
    width: int = SMALL_WINDOW[0],
    height: int = SMALL_WINDOW[1],
    pad: bool = True,
    touch: bool = False,
    scripts: Sequence[Path] = (),
) -> AsyncIterator[ConsolePage]:
    async with open_page(browser, link, width=width, height=height, pad=pad, touch=touch, scripts=scripts) as page:
        yield ConsolePage(page)
