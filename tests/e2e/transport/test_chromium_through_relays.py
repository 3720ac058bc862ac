"""A real Chromium behind console → Janus → Janus, each in its own network; a Janus is killed while it watches."""

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
import pytest_asyncio

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.event_strip import drawn_event
from lockstep.bench.relay.stage import FIRST_PORT, RelayStage, relay_stage
from lockstep.emulator.errors import NamespacesUnavailable

# As behind a proxy that lets no WebSocket of the console pass; those of relays do.
NO_LINES = """
const Real = window.WebSocket;
window.WebSocket = class extends Real {
  constructor(url, ...more) { super(String(url).includes("/watch/") ? "ws://127.0.0.1:9/" : url, ...more); }
};
"""

pytestmark = [pytest.mark.browser, pytest.mark.full_rate, pytest.mark.timeout(240)]


@pytest_asyncio.fixture(loop_scope="session")
async def stage(tmp_path: Path) -> AsyncIterator[RelayStage]:
    try:
        async with relay_stage(tmp_path) as ready:
            await ready.add_janus("robot", 0)
            await ready.add_janus("operator", 1)
            await ready.add_console([("robot", 0), ("operator", 1)], "--observers-direct", "0")
            yield ready
    except NamespacesUnavailable as error:
        pytest.skip(str(error))


async def test_pictures_keep_their_events_through_two_relays_and_come_back_when_one_dies(stage: RelayStage) -> None:
    await stage.add_driver()
    link = stage.links["observer"]
    async with (
        stage.chromium("operator") as browser,
        open_console(browser, link, pad=False) as near,
        AsyncExitStack() as pages,
    ):
        await near.until("s.relay !== null && s.streams.overview?.rendered > 3", 40)
        # Whoever asks before that is sent to the one relay that carries the session by then.
        assert stage.console is not None
        await stage.console.line(rf"relay carries the session.*:{FIRST_PORT + 1}\b")
        far = await pages.enter_async_context(open_console(browser, link, pad=False))
        await far.until("s.relay !== null && s.streams.overview?.rendered > 3", 40)
        before = [await page.stats() for page in (near, far)]
        assert [each["line"] for each in before] == [True, True]
        relays = [each["relay"] for each in before]
        assert sorted(relays) == ["0", "1"]
        watching = near if relays[0] == "1" else far
        await watching.until("s.streams.overview.rendered > 60", 60)
        shown = await drawn_event(watching.page, "overview")
        statistics = await watching.stats()
        await stage.janus[1].kill()
        await watching.until("s.relay === '0' && s.streams.overview?.rendered > 3", 60)
        after = await watching.stats()
        await watching.page.get_by_role("button", name="Stop").first.click()
        await watching.until("s.stop.stopped")
    assert shown is not None
    assert shown[0] == shown[1]
    for each in (statistics, after):
        assert [name for name, stream in each["streams"].items() if stream["violations"]] == []
        assert each["bad_messages"] == 0
    assert after["peer"] == statistics["peer"]  # the connection to the console lives on


async def test_where_no_websocket_passes_the_page_goes_on_by_data_channels(stage: RelayStage) -> None:
    async with stage.chromium("operator") as browser:
        context = await browser.new_context()
        await context.add_init_script(NO_LINES)
        page = ConsolePage(await context.new_page())
        await page.page.goto(stage.links["observer"])
        await page.until("s.connected && s.relay !== null && !s.line && s.streams.overview?.rendered > 3", 40)
        await page.page.get_by_role("button", name="Stop").first.click()
        await page.until("s.stop.stopped")
        assert (await page.stats())["bad_messages"] == 0
        await context.close()
