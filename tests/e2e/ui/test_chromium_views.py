"""Where the views stand: pictures have the room that is there, nothing lies over another, and no box is empty."""

from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage
from tests.e2e.machine import open_on_machine, until_drawn
from tests.server.media.sources.media_files import film
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.browser

LAPTOP, FULL_HD, NARROW, UPRIGHT = (1366, 768), (1920, 1080), (1024, 640), (1024, 1366)
PHONE, SMALL_PHONE, TURNED, ZOOMED = (390, 844), (360, 640), (844, 390), (683, 384)
TABLET = (820, 1180)

# After the next layout: every box, and how large the picture in it is drawn.
LOOK = """() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(() => {
  const box = (element) => {
    const { x, y, width, height } = element.getBoundingClientRect();
    return { x, y, width, height };
  };
  const views = [...document.querySelectorAll(".view")].map((view) => {
    const canvas = view.querySelector("canvas");
    const share = canvas && Math.min(canvas.clientWidth / canvas.width, canvas.clientHeight / canvas.height);
    const empty = canvas === null || canvas.clientWidth < 40 || canvas.clientHeight < 30;
    const { view: name, place } = view.dataset;
    return { name, place, empty, picture: canvas && canvas.width * share, ...box(view) };
  });
  const gauges = [...document.querySelectorAll(".gauges > *")].filter((each) => each.checkVisibility());
  const room = document.querySelector(".views");
  const named = (name, found) => found.map((each) => ({ name, ...box(each) }));
  const all = (selector) => [...document.querySelectorAll(selector)].filter((each) => each.checkVisibility());
  resolve({
    views,
    gauges: named("a gauge", gauges),
    room: box(room),
    others: [...named("the event", all(".event")), ...named("STOP", all(".stop")), ...named("a stick", all(".stick"))],
  });
})))"""


async def _look(console: ConsolePage, size: tuple[int, int]) -> dict[str, Any]:
    await console.page.set_viewport_size({"width": size[0], "height": size[1]})
    looked: dict[str, Any] = await console.page.evaluate(LOOK)
    return looked


def _overlaps(one: dict[str, Any], other: dict[str, Any]) -> bool:
    apart = [
        one[at] + one[length] <= other[at] + 0.5 or other[at] + other[length] <= one[at] + 0.5
        for at, length in (("x", "width"), ("y", "height"))
    ]
    return not any(apart)


def _check(looked: dict[str, Any], what: str) -> None:
    boxes = looked["views"] + looked["gauges"]
    room = looked["room"]
    for at, box in enumerate(boxes):
        for other in boxes[at + 1 :]:
            assert not _overlaps(box, other), f"{what}: {box['name']} and {other['name']}"
        assert box["x"] >= room["x"] - 0.5, f"{what}: {box['name']}"
        assert box["x"] + box["width"] <= room["x"] + room["width"] + 0.5, f"{what}: {box['name']}"
        assert box["y"] + box["height"] <= room["y"] + room["height"] + 0.5, f"{what}: {box['name']}"
    for view in looked["views"]:
        assert not view["empty"], f"{what}: {view['name']} is an empty box"


def _in_a_fixed_column(room: dict[str, Any]) -> tuple[float, float]:
    """How wide the large and a small picture, both 4 by 3, are where the column beside has 17 % of the width."""
    width, height = room["width"] - 24, room["height"] - 24
    column = min(216.0, max(150.0, 0.17 * width))
    return min(width - 12 - column, height * 4 / 3), column


@pytest.mark.parametrize("scene", [False, True], ids=["without scene", "with scene"])
async def test_on_large_screens_pictures_take_the_room_and_nothing_lies_over_another(
    stack: Stack, chromium: Browser, scene: bool
) -> None:
    async with open_on_machine(chromium, stack.operator, renderer=None) as console:
        await console.until_live()
        if scene:
            await console.page.get_by_role("button", name="3D scene", exact=True).click()
            await until_drawn(console)
        for charts in ("without charts", "with charts"):
            for size in (LAPTOP, FULL_HD, NARROW, UPRIGHT):
                what = f"{size} {charts}"
                looked = await _look(console, size)
                _check(looked, what)
                large, small = _in_a_fixed_column(looked["room"])
                pictures = {view["name"]: view["picture"] for view in looked["views"]}
                assert pictures["overview"] >= large - 1, what
                # On the smallest the scene, which somebody asked for, leaves the camera less than all of the column.
                assert pictures["front"] >= small - 1 or (scene and size == NARROW), what
            await console.page.keyboard.press("c")
        full_hd = await _look(console, FULL_HD)
        by_name = {view["name"]: view for view in full_hd["views"]}
        assert by_name["overview"]["width"] - by_name["overview"]["picture"] < 60, "its box is hardly wider than it"


async def test_on_small_screens_no_box_is_empty_and_the_large_picture_has_its_room(
    stack: Stack, chromium: Browser
) -> None:
    async with open_on_machine(chromium, stack.operator, touch=True, width=390, height=844) as console:
        await console.until_live()
        phone = await _look(console, PHONE)
        _check(phone, "phone")
        assert [view["name"] for view in phone["views"]] == ["overview", "front"]
        assert phone["gauges"] == []
        for size in (TURNED, ZOOMED):
            looked = await _look(console, size)
            large, small = looked["views"]
            assert not large["empty"]
            assert not small["empty"]
            if size == TURNED:
                assert small["x"] >= large["x"] + large["picture"] - 1, "it lies beside the picture, not over it"


def _box_of(looked: dict[str, Any], name: str) -> dict[str, Any]:
    found: dict[str, Any] = next(each for each in looked["others"] if each["name"] == name)
    return found


def _empty_share(looked: dict[str, Any]) -> float:
    """Of the room of the views, what stands empty behind the small ones in their row."""
    small = [view for view in looked["views"] if view["place"] == "small"]
    room, event = looked["room"], _box_of(looked, "the event")
    bottom = max(view["y"] + view["height"] for view in small)
    row = [view for view in small if abs(view["y"] + view["height"] - bottom) < 1]
    large = next(view for view in looked["views"] if view["place"] == "main")
    if row[0]["y"] < large["y"] + large["height"]:
        return 0.0  # a column beside the large one
    end = event["x"] if event["y"] < bottom else room["x"] + room["width"]
    empty = end - max(view["x"] + view["width"] for view in row)
    return float(max(0.0, empty) * row[0]["height"] / (room["width"] * room["height"]))


@pytest.mark.parametrize("more", [(), ("wide",), ("wide", "tall", "square")], ids=["two", "three", "five"])
async def test_on_upright_screens_pictures_take_the_room_that_stands_empty(
    tmp_path: Path, chromium: Browser, more: tuple[str, ...]
) -> None:
    shapes = {"wide": (320, 180), "tall": (180, 320), "square": (200, 200)}
    cameras = [f"--camera={name}=file:{film(tmp_path / f'{name}.mp4', size=shapes[name])}" for name in more]
    async with running_stack(tmp_path, extra=(*cameras, "--quiet")) as stack:
        for role, link in (("operator", stack.operator), ("observer", stack.observer)):
            await _no_room_stands_empty(chromium, link, role)


async def _no_room_stands_empty(chromium: Browser, link: str, role: str) -> None:
    async with open_on_machine(chromium, link, touch=True, width=390, height=844) as console:
        await console.until_live()
        for size in (PHONE, SMALL_PHONE, TABLET):
            what = f"{size} {role}"
            looked = await _look(console, size)
            _check(looked, what)
            for other in looked["others"]:
                assert not any(_overlaps(view, other) for view in looked["views"]), f"{what}: {other['name']}"
                assert other["y"] + other["height"] <= size[1] + 0.5, f"{what}: {other['name']}"
            large = next(view for view in looked["views"] if view["place"] == "main")
            margins = large["x"], size[0] - max(view["x"] + view["width"] for view in looked["views"])
            assert abs(margins[0] - margins[1]) < 1, f"{what}: as much beside the views on the right as on the left"
            sticks = [each for each in looked["others"] if each["name"] == "a stick"]
            assert len(sticks) == (2 if role == "operator" else 0)
            assert all(stick["height"] >= 90 for stick in sticks), what
            assert _empty_share(looked) < 0.1, what


async def test_on_a_phone_the_scene_that_somebody_asked_for_has_a_place_beside_the_small_pictures(
    stack: Stack, chromium: Browser
) -> None:
    chosen = "localStorage.setItem('lockstep.scene', 'shown')"
    async with open_on_machine(
        chromium, stack.operator, renderer=None, touch=True, width=390, height=844, scripts=(chosen,)
    ) as console:
        await until_drawn(console)
        phone = await _look(console, PHONE)
        _check(phone, "phone")
        assert [view["name"] for view in phone["views"]] == ["overview", "front", "3D scene"]
        assert phone["gauges"] == []


async def test_a_view_taken_large_changes_places_with_the_large_one(stack: Stack, chromium: Browser) -> None:
    async with open_on_machine(chromium, stack.operator) as console:
        await console.until_live()
        await until_drawn(console)
        await console.page.get_by_role("button", name="Show Front large").click()
        looked = await _look(console, LAPTOP)
        _check(looked, "front large")
        places = {view["name"]: view["place"] for view in looked["views"]}
        assert places == {"overview": "small", "front": "main", "3D scene": "small"}
        await console.page.get_by_role("button", name="Show Overview large").click()
        await console.page.get_by_role("button", name="3D scene", exact=True).click()
        looked = await _look(console, LAPTOP)
        _check(looked, "the scene is hidden")
        assert {view["name"]: view["place"] for view in looked["views"]} == {"overview": "main", "front": "small"}
