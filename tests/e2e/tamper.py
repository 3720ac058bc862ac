"""A page that hears what a test wants it to hear: what the console says is changed on its way in."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import PAD
from lockstep.bench.browsers.console_page import SMALL_WINDOW, ConsolePage

__all__ = ["TAMPER", "alter", "open_tampered", "say"]

TAMPER = Path(__file__).with_name("tamper.js")
ALTER = """(change) => {
  window.tamper = (_, message) => {
    if (message.stop === undefined || message.type === "refusal") return message;
    const stop = { ...message.stop, ...(change.stop ?? {}) };
    return message.type === "feedback" ? { ...message, ...change, stop } : { ...message, stop };
  };
}"""


@asynccontextmanager
async def open_tampered(
    browser: Browser,
    link: str,
    *,
    width: int = SMALL_WINDOW[0],
    height: int = SMALL_WINDOW[1],
    touch: bool = False,
    **context_options: Any,
) -> AsyncIterator[ConsolePage]:
    """A page whose messages `alter` and `say` change; uncaught errors of the page fail the test on leaving."""
    context = await browser.new_context(viewport={"width": width, "height": height}, has_touch=touch, **context_options)
    try:
        for script in (PAD, TAMPER):
            await context.add_init_script(path=script)
        page = await context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        await page.goto(link)
        yield ConsolePage(page)
        assert not errors, "the page threw: " + "; ".join(errors)
    finally:
        await context.close()


async def alter(console: ConsolePage, **change: Any) -> None:
    """From now on every feedback has these fields, and every stop state those of `stop`."""
    await console.page.evaluate(ALTER, change)


async def say(console: ConsolePage, channel: str, message: dict[str, Any]) -> None:
    """The page hears this message, which nobody has sent."""
    await console.page.evaluate("([channel, message]) => window.say(channel, message)", [channel, message])
