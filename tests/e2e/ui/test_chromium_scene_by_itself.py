"""The 3D scene that nobody has asked for: it comes where the machine has room for it, and else leaves no empty box."""

import asyncio
import io
from typing import Any

import pytest
from PIL import Image
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage
from tests.e2e.machine import open_on_machine, until_drawn
from tests.e2e.tamper import TAMPER
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

# Later than this after the first picture the page has decided; two answers of its rule have passed since.
DECIDED = "performance.now() - window.lockstep.rendered('overview')[0].at > 3500"
FIGURES = "[...document.querySelectorAll('.view')].map((each) => each.dataset.view)"
CODE = "performance.getEntriesByType('resource').filter((each) => each.name.includes('scene_renderer'))"

# At every frame: what the page's own drawing and the picture show, and whether the drawing may be seen.
WATCH = """() => {
  window.watched = [];
  const look = () => {
    const { event, gap } = lockstep.scene();
    const veiled = !document.querySelector('[data-view="3D scene"] .veil').hidden;
    watched.push({ event, gap, veiled, picture: lockstep.rendered("overview").at(-1).stamp });
    requestAnimationFrame(look);
  };
  look();
}"""


def _toggle(console: ConsolePage) -> Locator:
    return console.page.get_by_role("button", name="3D scene", exact=True)


async def _colours(console: ConsolePage) -> int:
    """How many the scene has on the screen: an empty box has a handful."""
    picture = await console.page.locator('[data-view="3D scene"] .scene-canvas').screenshot()
    colours = Image.open(io.BytesIO(picture)).convert("RGB").getcolors(maxcolors=1 << 20)
    return 0 if colours is None else len(colours)


async def test_the_robot_stands_in_the_scene_by_itself_where_the_machine_has_graphics(
    stack: Stack, chromium: Browser
) -> None:
    asked: list[str] = []
    async with open_on_machine(chromium, stack.operator) as console:
        console.page.on("request", lambda request: asked.append(request.url))
        await console.until_live()
        await until_drawn(console)
        assert await _colours(console) > 30
        await expect(_toggle(console)).to_have_attribute("aria-pressed", "true")
        assert not [url for url in asked if "/scene" in url and "scene_renderer" not in url], (
            "the console serves nothing"
        )
        first = await console.page.evaluate("window.lockstep.rendered('overview')[0].at")
        code = await console.page.evaluate(f"{CODE}.map((each) => each.startTime)")
        assert len(code) > 0
        assert min(code) > first, "what draws it comes after the first picture"


@pytest.mark.alone  # a page gives up a scene that it draws too slowly
async def test_the_scene_drawn_by_the_page_shows_no_newer_event_than_the_picture_and_no_old_one_unveiled(
    stack: Stack, chromium: Browser
) -> None:
    async with open_on_machine(chromium, stack.operator) as console:
        await console.until_live()
        await until_drawn(console)
        await console.page.evaluate(WATCH)
        async with console.driving():
            start = (await console.stats())["event"]
            await console.until(f"s.event > {start + 40} && window.lockstep.scene().event > {start + 30}", 60)
        watched: list[dict[str, Any]] = await console.page.evaluate("watched")
        tolerance = (await console.stats())["tolerance"]["video"]
        seen = [each for each in watched if each["event"] is not None]
        assert len({each["event"] for each in seen}) > 10
        for each in seen:
            assert each["event"] <= each["picture"] or abs(each["gap"]) <= tolerance, each
            assert each["veiled"] or abs(each["gap"]) <= tolerance, each
        assert sum(each["event"] == each["picture"] for each in seen) > len(seen) / 2
        await console.pad.let_go()
        async with console.driving():
            await console.page.evaluate("void (window.requestAnimationFrame = () => 1)")  # nothing is drawn any more
            await console.page.locator('[data-view="3D scene"] .veil-words').get_by_text("events behind").wait_for()


async def test_the_scene_is_veiled_while_nothing_is_heard_of_the_robot(stack: Stack, chromium: Browser) -> None:
    async with open_on_machine(chromium, stack.observer) as console:
        await console.until_live()
        await until_drawn(console)
        with stack.frozen_console():
            await console.page.locator('[data-view="3D scene"] .veil-words').get_by_text("No feedback for").wait_for()


async def test_it_stays_away_and_leaves_no_box_without_graphics_on_a_phone_or_where_data_is_dear(
    stack: Stack, chromium: Browser
) -> None:
    machines: dict[str, dict[str, Any]] = {
        "no graphics hardware": {"renderer": None},
        "drawn by the processor": {"renderer": "llvmpipe (LLVM 15.0.7, 256 bits)"},
        "data saver": {"save_data": True},
        "narrow network": {"downlink": 0.4},
        "phone": {"width": 390, "height": 844, "touch": True},
    }

    places = asyncio.Semaphore(2)  # pages at a time: they wait more than they compute, but a machine has two cores

    async def stays_away(name: str, facts: dict[str, Any]) -> None:
        async with places, open_on_machine(chromium, stack.observer, **facts) as console:
            await console.until_live()
            await console.until(DECIDED)
            assert await console.page.evaluate(FIGURES) == ["overview", "front"], name
            assert await console.page.evaluate(f"{CODE}.length") == 0, name
            assert await console.page.evaluate("window.lockstep.scene().state") == "away", name

    async with asyncio.TaskGroup() as tasks:
        for name, facts in machines.items():
            tasks.create_task(stays_away(name, facts))


async def test_what_the_person_decides_is_remembered_either_way(stack: Stack, chromium: Browser) -> None:
    async with open_on_machine(chromium, stack.observer, renderer=None) as console:
        await console.until_live()
        await _toggle(console).click()
        await until_drawn(console)
        await console.page.reload()
        await until_drawn(console)
        await _toggle(console).click()
        await console.until(f"{FIGURES}.join() === 'overview,front'")
        await console.page.reload()
        await console.until_live()
        await console.until(DECIDED)
        assert await console.page.evaluate("window.lockstep.scene().state") == "away"
    async with open_on_machine(chromium, stack.observer) as console:
        await until_drawn(console)
        await _toggle(console).click()
        await console.page.reload()
        await console.until_live()
        await console.until(DECIDED)
        assert await console.page.evaluate("window.lockstep.scene().state") == "away", "though the machine could"


# The robot says nothing of its shape, as many robots of one's own do.
SHAPELESS = """window.tamper = (_, message) => message.type === "robot"
  ? { ...message, description: { ...message.description, bodies: [] } } : message;"""


async def test_a_robot_without_a_shape_has_neither_a_box_nor_a_button_for_it(stack: Stack, chromium: Browser) -> None:
    async with open_on_machine(chromium, stack.observer, scripts=(TAMPER.read_text() + SHAPELESS,)) as console:
        await console.until_live()
        await console.until(DECIDED)
        assert await console.page.evaluate(FIGURES) == ["overview", "front"]
        await expect(_toggle(console)).to_have_count(0)


async def test_while_the_full_scene_opens_and_when_it_cannot_the_robot_stays_in_sight(
    stack: Stack, chromium: Browser
) -> None:
    async with open_on_machine(chromium, stack.observer) as console:
        await console.page.route("**/api/scene", lambda route: route.fulfill(status=503, body="{}"))
        await console.until_live()
        await until_drawn(console)
        await console.open_full_scene()
        view = console.page.locator('[data-view="3D scene"][data-place="main"]')
        await view.get_by_text("The full 3D scene is not available now").wait_for()
        assert await console.page.evaluate("window.lockstep.scene().state") == "drawn"
        assert await _colours(console) > 30
