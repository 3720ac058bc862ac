"""In no state of a page does axe-core find anything; at 200 % and in forced colours nothing that matters is lost."""

import re
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page

from lockstep.bench.browsers.chromium import open_page
from lockstep.bench.browsers.console_page import ConsolePage
from tests.e2e.accessibility import findings
from tests.e2e.machine import until_drawn
from tests.e2e.overview import in_view, until
from tests.e2e.tamper import alter, open_tampered, say
from tests.support.stack import Stack, running_fleet

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]

State = Callable[[ConsolePage], Awaitable[None]]

NUMBER = 9_000_000_000_000_000  # newer than any that the shared robot has given; a restart of its bridge takes a leap
STOPPED = {"stopped": True, "by": "Ann", "reason": "stop button", "number": NUMBER}


async def _ready(console: ConsolePage) -> None:
    await console.until_live()


async def _armed(console: ConsolePage) -> None:
    await console.arm()


async def _warns(console: ConsolePage) -> None:
    await alter(console, warning=3.0)
    await console.page.locator(".alarm").get_by_text("The robot warns").wait_for()


async def _stopped(console: ConsolePage) -> None:
    await alter(console, stop=STOPPED)
    await console.page.get_by_role("button", name="Hold to reset").wait_for()


async def _not_kept_and_refused(console: ConsolePage) -> None:
    await alter(console, stop=STOPPED | {"kept": False, "number": NUMBER + 1})
    refusal = {"event": 0, "reason": "stale_reset", "current": 1, "detail": "", "stop": NUMBER}
    await say(console, "stop", {"type": "refusal"} | refusal)
    await console.page.locator(".plate").get_by_text("could not save").wait_for()
    await console.page.locator(".plate").get_by_text("Not reset").wait_for()


async def _locked(console: ConsolePage) -> None:
    await alter(console, stop=STOPPED | {"locked_out": "key switch at the door", "number": NUMBER + 2})
    await console.page.locator(".plate").get_by_text("key switch at the door").wait_for()


async def _unconfirmed(console: ConsolePage) -> None:
    await console.page.evaluate("void (window.mute = 'stop')")
    await console.page.route("**/api/stop", lambda route: route.abort())
    await console.page.keyboard.press("Escape")
    await console.page.locator(".alarm").get_by_text("has not confirmed your STOP").wait_for()


async def _silenced(console: ConsolePage) -> None:
    refusal = {"event": 0, "reason": "silenced", "current": 1, "detail": "", "stop": 0}
    await say(console, "stop", {"type": "refusal"} | refusal)
    await console.page.locator(".alarm").get_by_text("had no effect").wait_for()


async def _tab(console: ConsolePage, name: str) -> None:
    await console.page.get_by_role("tab", name=name).click()


async def _people_and_silencing(console: ConsolePage) -> None:
    peer = {"peer": "other", "name": "Bo", "role": "observer", "carrier": "capture-time", "gap": 0, "tier": "low"}
    figures = {"picture_delay_ms": None, "round_trip_ms": 12.0, "loss": 0.01, "silenced": False}
    silenced = {"peer": "third", "name": "Cy", "silenced": True}
    await console.page.evaluate("void (window.tamper = (_, m) => m.type === 'participants' ? null : m)")
    people = [peer | figures, peer | figures | silenced]
    await say(console, "session", {"type": "participants", "participants": people})
    await _tab(console, "People")
    await console.page.get_by_role("listitem").filter(has_text="Bo").get_by_role("button", name="Silence STOP…").click()
    await console.page.get_by_text("STOP from Bo’s link, and from links that were made with it").wait_for()


async def _notes(console: ConsolePage) -> None:
    await _tab(console, "Notes")


async def _scene(console: ConsolePage) -> None:
    await console.page.get_by_role("button", name="3D scene", exact=True).click()
    await until_drawn(console)


async def _charts(console: ConsolePage) -> None:
    await console.page.keyboard.press("c")


async def _sheet(console: ConsolePage, key: str) -> None:
    await console.page.keyboard.press(key)
    await console.page.get_by_role("dialog").wait_for()


async def _keys(console: ConsolePage) -> None:
    await console.page.keyboard.press("c")
    await _sheet(console, "h")


async def _pads(console: ConsolePage) -> None:
    await _sheet(console, "g")


async def _inviting(console: ConsolePage) -> None:
    await console.page.get_by_role("dialog").get_by_role("button", name="Close").click()
    await _tab(console, "People")
    await console.page.get_by_role("button", name="Invite…").click()
    await console.page.get_by_role("dialog").wait_for()


async def _audit(console: ConsolePage) -> None:
    await console.page.get_by_role("dialog").get_by_role("button", name="Close").click()
    await console.page.get_by_role("button", name="Audit trail…").click()
    await console.page.get_by_role("dialog").get_by_text("start").first.wait_for()


SUPERVISOR: tuple[State, ...] = (
    _ready,
    _scene,
    _notes,
    _people_and_silencing,
    _charts,
    _keys,
    _pads,
    _inviting,
    _audit,
)
DRIVING: tuple[State, ...] = (_ready, _armed, _warns, _stopped, _not_kept_and_refused, _locked, _unconfirmed, _silenced)


async def _through(console: ConsolePage, states: tuple[State, ...], *without: str) -> list[str]:
    found: list[str] = []
    for state in states:
        await state(console)
        found += [f"{state.__name__}: {each}" for each in await findings(console.page, *without)]
        assert await in_view(console.page, "STOP the robot"), state.__name__
        wider = await console.page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert wider <= 0, f"{state.__name__} is wider than the screen by {wider} px"
    return found


async def test_axe_finds_nothing_on_a_page_that_drives_in_any_state(stack: Stack, chromium: Browser) -> None:
    async with open_tampered(chromium, stack.operator, width=1366, height=768) as console:
        assert await _through(console, DRIVING) == []


async def test_axe_finds_nothing_in_a_supervisors_tabs_and_dialogues(own_stack: Stack, chromium: Browser) -> None:
    async with open_tampered(chromium, own_stack.supervisor, width=1366, height=768) as console:
        assert await _through(console, SUPERVISOR) == []


async def test_at_200_percent_and_on_a_phone_all_states_fit_and_axe_finds_nothing(
    stack: Stack, chromium: Browser
) -> None:
    async with open_tampered(chromium, stack.operator, width=683, height=384, device_scale_factor=2) as zoomed:
        assert await _through(zoomed, DRIVING) == []
    async with open_tampered(chromium, stack.operator, width=390, height=844, touch=True) as phone:
        assert await _through(phone, DRIVING) == []
        plate = await phone.page.locator(".plate-news").bounding_box()
        stop = await phone.page.get_by_role("button", name="STOP the robot").bounding_box()
        assert plate is None or (stop is not None and plate["y"] + plate["height"] <= stop["y"])


async def test_in_forced_colours_axe_finds_nothing_and_stop_keeps_its_edge(stack: Stack, chromium: Browser) -> None:
    async with open_tampered(chromium, stack.operator, width=1366, height=768, forced_colors="active") as console:
        # The person's colours take the place of ours when they are drawn; axe-core computes with those that it reads.
        assert await _through(console, DRIVING, "color-contrast") == []
        edge = "(element) => getComputedStyle(element).borderTopStyle"
        for part in (".stop", ".plate", ".alarm"):
            assert await console.page.locator(part).evaluate(edge) == "solid", part


@pytest_asyncio.fixture(loop_scope="session")
async def fleet(tmp_path: Path) -> AsyncIterator[Stack]:
    async with running_fleet(tmp_path, {"left": "planar", "right": "planar"}) as running:
        yield running


async def _overview_in_all_states(page: Page) -> list[str]:
    await until(page, "s.robots.length === 2 && s.robots.every((x) => x.picture === 'live')")
    found = await findings(page)
    await page.get_by_role("searchbox").fill("no robot of this name")
    await page.get_by_text("no robot of this name").wait_for()
    found += await findings(page)
    await page.get_by_role("searchbox").fill("")
    await page.keyboard.press("Escape")
    await until(page, "s.stop && s.stop.tone === 'done' && s.robots.every((x) => x.state === 'stopped')")
    found += await findings(page)
    await page.get_by_role("button", name="Audit trail").click()
    await page.get_by_role("dialog").wait_for()
    return found + await findings(page)


async def test_axe_finds_nothing_on_a_fleets_page_and_on_recordings(fleet: Stack, chromium: Browser) -> None:
    async with open_page(chromium, fleet.supervisor) as page:
        assert await _overview_in_all_states(page) == []
    async with open_page(chromium, re.sub("token=.*", "token=wrong", fleet.observer), width=683, height=384) as page:
        await page.get_by_role("heading", name="This link is not valid").wait_for()
        assert await findings(page) == []
    for link in (fleet.operator.replace("/#", "/robots/left/recordings#"), fleet.console + "/robots/left/recordings"):
        async with open_page(chromium, link) as page:
            await page.get_by_role("heading", level=1).wait_for()
            assert await findings(page) == []
