"""Handles the page as its user does, and reads its statistics, for tests in Chromium."""

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

from playwright.async_api import Browser, Page

from lockstep.bench.browsers.chromium import missed_in_page, open_page

__all__ = ["FORWARD", "LEFT_X", "LEFT_Y", "RB", "SMALL_WINDOW", "START", "ConsolePage", "open_console"]

# The smallest size that shows all of the page at once: where the processor draws, each pixel of the window costs.
SMALL_WINDOW = (1024, 640)
START, RB, STOP_BUTTON = 9, 5, 1  # W3C standard mapping
LEFT_X, LEFT_Y, RIGHT_X = 0, 1, 2
FORWARD = MappingProxyType({LEFT_Y: -1.0})
ROUND = MappingProxyType({LEFT_Y: -1.0, RIGHT_X: -1.0})  # the planar robot in a circle of half a metre: it stays near
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

# The true event, read from the strip that the planar robot draws into its pictures (robots/event_strip.py), together
# with the stamp that the page believes it has. It is one expression, so no picture is drawn in between.
READ_STRIP = """(name) => {
  const canvas = document.querySelector(`canvas[data-stream="${name}"]`);
  const rendered = window.lockstep.rendered(name).at(-1);
  if (!canvas || !rendered || canvas.width === 0) return null;
  const rows = Math.floor(canvas.height / 20);
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, rows).data;
  let event = 0, parity = 0, last = 0;
  for (let cell = 0; cell < 32; cell++) {
    const left = Math.floor(cell * canvas.width / 32), right = Math.floor((cell + 1) * canvas.width / 32);
    const quarter = Math.floor((right - left) / 4), edge = Math.floor(rows / 4);
    let sum = 0, count = 0;
    for (let y = edge; y < rows - edge; y++) for (let x = left + quarter; x < right - quarter; x++) {
      const at = 4 * (y * canvas.width + x);
      sum += 0.299 * pixels[at] + 0.587 * pixels[at + 1] + 0.114 * pixels[at + 2];
      count++;
    }
    const mean = sum / count;
    if (mean >= 90 && mean <= 160) return { stamp: rendered.stamp, event: null };
    const bit = mean > 160 ? 1 : 0;
    if (cell < 31) { event = event * 2 + bit; parity ^= bit; } else last = bit;
  }
  return { stamp: rendered.stamp, event: parity === last ? event : null };
}"""


# The hook is in the code that the page loads after its first picture.
STATISTICS = """new Promise((resolve) => {
  const look = () => (window.lockstep ? resolve(window.lockstep.stats()) : setTimeout(look, 20));
  look();
})"""


class ConsolePage:
    """One open page. Each wait is for something that the page reports, never for time to pass."""

    def __init__(self, page: Page) -> None:
        self.page = page

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

    async def press(self, button: int, pressed: bool = True) -> None:
        """Press as a finger does: no shorter than the page's sampling can see."""
        await self.page.evaluate(
            "([button, pressed]) => { window.testPad.press(button, pressed); return window.testPad.seen(); }",
            [button, pressed],
        )

    async def tilt(self, axis: int, value: float) -> None:
        await self.page.evaluate("([axis, value]) => window.testPad.tilt(axis, value)", [axis, value])

    async def arm(self) -> None:
        """Press the pad's START, as an operator does: let go and press again if nothing happens."""
        await self.until("s.seat && s.seat.mine")
        for _ in range(ARM_TRIES - 1):
            await self.press(START)
            missed = await self._missed("s.armed", ARM_SECONDS)
            await self.press(START, False)
            if missed is None:
                return
        await self.press(START)
        await self.until("s.armed", 20)
        await self.press(START, False)

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
            await self.press(RB)
            for axis, value in tilts.items():
                await self.tilt(axis, value)
            await self.until("!s.armed || (s.driving && s.at_rest === false)")
            if not await self.was_held_up():
                break
            await self._arm_anew(tilts)
        await self.until("s.driving && s.at_rest === false", 20)

    @asynccontextmanager
    async def driving(self, tilts: Mapping[int, float] = ROUND) -> AsyncIterator[None]:
        """Arm and drive inside the block, again if a busy machine ended that; deadman and sticks stay held.

        Anything else that ends it, such as a stop, lasts.
        """
        await self.arm()
        await self.drive_forward(tilts)
        going_on = asyncio.create_task(self._go_on(tilts))
        try:
            yield
        finally:
            going_on.cancel()
            await asyncio.gather(going_on, return_exceptions=True)

    async def _go_on(self, tilts: Mapping[int, float]) -> None:
        while True:
            await self._missed("!s.armed", 600)
            if not await self.was_held_up():
                return
            await self._arm_anew(tilts)
            await self.drive_forward(tilts)

    async def _arm_anew(self, tilts: Mapping[int, float]) -> None:
        await self.press(RB, False)
        for axis in tilts:
            await self.tilt(axis, 0)
        await self.until("s.connected")
        await self.arm()

    async def let_go(self) -> None:
        """Let go of the deadman and the sticks."""
        await self.press(RB, False)
        for axis in ROUND:
            await self.tilt(axis, 0)

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
                await self.press(RB)
                await self.tilt(LEFT_Y, -1)
                await self.until(f"!s.armed || ({condition})", seconds)
                if await self._missed(condition, 0) is None:
                    return
                await self.let_go()

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

    async def strip(self, stream: str) -> tuple[int, int | None] | None:
        """Return the stamp the page believes its picture has, and the event drawn into it; None before the first."""
        found = await self.page.evaluate(READ_STRIP, stream)
        return None if found is None else (found["stamp"], found["event"])


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
