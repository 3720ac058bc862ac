"""Pages of machines that this one is not: what the browser says of graphics, network and data is the test's."""

import json
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

from playwright.async_api import Browser

from lockstep.bench.browsers.chromium import PAD
from lockstep.bench.browsers.console_page import SMALL_WINDOW, ConsolePage

__all__ = ["GRAPHICS", "open_on_machine", "until_drawn"]

GRAPHICS = "ANGLE (Intel, Mesa Intel(R) UHD Graphics 620 (KBL GT2), OpenGL 4.6)"

TRIES = 4
DRAWN = "window.lockstep.scene().state === 'drawn'"
GAVE_UP = "document.body.textContent.includes('this machine draws it too slowly')"

# The drawing itself is the processor's, as everywhere in these tests.
MACHINE = """(() => {
  const { renderer, downlink, saveData } = %s;
  const network = { saveData, downlink };
  Object.defineProperty(Navigator.prototype, "connection", { get: () => network });
  const { getContext } = HTMLCanvasElement.prototype;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    if (options?.failIfMajorPerformanceCaveat && renderer === null) return null;
    return getContext.call(this, kind, options && { ...options, failIfMajorPerformanceCaveat: false });
  };
  const { getParameter } = WebGL2RenderingContext.prototype;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    const { UNMASKED_RENDERER_WEBGL } = this.getExtension("WEBGL_debug_renderer_info");
    return name === UNMASKED_RENDERER_WEBGL ? renderer : getParameter.call(this, name);
  };
})();"""


@asynccontextmanager
async def open_on_machine(
    browser: Browser,
    link: str,
    *,
    renderer: str | None = GRAPHICS,
    downlink: float = 10.0,
    save_data: bool = False,
    width: int = SMALL_WINDOW[0],
    height: int = SMALL_WINDOW[1],
    touch: bool = False,
    scripts: Sequence[str] = (),
    **context_options: Any,
) -> AsyncIterator[ConsolePage]:
    """A page whose browser names this renderer; None: it has no graphics hardware. `downlink` in Mbit/s.

    Uncaught errors of the page fail the test on leaving.
    """
    facts = {"renderer": renderer, "downlink": downlink, "saveData": save_data}
    context = await browser.new_context(viewport={"width": width, "height": height}, has_touch=touch, **context_options)
    try:
        await context.add_init_script(path=PAD)
        for script in (MACHINE % json.dumps(facts), *scripts):
            await context.add_init_script(script)
        page = await context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        await page.goto(link)
        yield ConsolePage(page)
        assert not errors, "the page threw: " + "; ".join(errors)
    finally:
        await context.close()


async def until_drawn(console: ConsolePage) -> None:
    """Until the page draws its scene; it is loaded anew where it gave the scene up, as it does on a busy machine."""
    for _ in range(TRIES):
        await console.until(f"{DRAWN} || {GAVE_UP}", 60)
        if await console.page.evaluate(DRAWN):
            return
        await console.page.reload()
        await console.until_live()
    raise AssertionError("the page gives the scene up each time: this machine is too slow for it")
