"""How pictures come to the page's canvas in real Chromium, and from there to the window."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.window_trace import traced_window
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

LISTS_TRANSFORMS = """(() => {
  window.transforms = [];
  const Plain = RTCRtpScriptTransform;
  window.RTCRtpScriptTransform = class extends Plain {
    constructor(worker, options) {
      super(worker, options);
      window.transforms.push(options.kind);
    }
  };
})()"""
TELLS_NO_EVENT = """(() => {
  const { getSynchronizationSources } = RTCRtpReceiver.prototype;
  RTCRtpReceiver.prototype.getSynchronizationSources = function () {
    return getSynchronizationSources.call(this).map(({ rtpTimestamp }) => ({ rtpTimestamp }));
  };
})()"""
DRAWN = "s.streams.overview.rendered > 10 && s.streams.front.rendered > 10"


@asynccontextmanager
async def _opened(chromium: Browser, link: str, *scripts: str) -> AsyncIterator[ConsolePage]:
    context = await chromium.new_context()
    try:
        for script in scripts:
            await context.add_init_script(script=script)
        page = await context.new_page()
        await page.goto(link)
        yield ConsolePage(page)
    finally:
        await context.close()


async def test_pictures_reach_the_window_on_surfaces_of_their_own_and_not_with_the_pages_next_frame(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        async with traced_window(chromium) as traces:
            shown = (await console.stats())["streams"]["overview"]["rendered"]
            await console.until(f"s.streams.overview.rendered > {shown + 10}")
    assert traces[0].shown_by_surface(0.0) is not None


async def test_chromium_reads_the_events_of_pictures_without_a_transform(stack: Stack, chromium: Browser) -> None:
    async with _opened(chromium, stack.operator, LISTS_TRANSFORMS) as console:
        await console.until(DRAWN)
        assert set(await console.page.evaluate("window.transforms")) == {"audio"}


async def test_a_browser_whose_receivers_tell_no_events_gets_its_pictures_by_transforms(
    stack: Stack, chromium: Browser
) -> None:
    async with _opened(chromium, stack.operator, LISTS_TRANSFORMS, TELLS_NO_EVENT) as console:
        await console.until(DRAWN)
        assert set(await console.page.evaluate("window.transforms")) == {"audio", "video"}
        streams = (await console.stats())["streams"]
        assert {streams[name]["violations"] for name in ("overview", "front")} == {0}
