"""The map on the page: where the robot is, and goals by a click of a mouse and a finger that rests."""

import math
import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Browser, Error, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import RB
from tests.client.live.truth import until_logged
from tests.e2e.accessibility import findings
from tests.e2e.armed import arm_at_rest
from tests.e2e.map_page import open_map, place_on_map
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

TRIES = 3  # a busy machine may hold the page up, which disarms it and so cancels the goal
SIZE = (8.4, 6.4)  # m, of the planar robot's map


async def _place(canvas: Locator, x: float, y: float) -> tuple[float, float]:
    return await place_on_map(canvas, x, y, SIZE)


def _words(console: ConsolePage) -> Locator:
    return console.page.locator(".map-words")


async def _picture(console: ConsolePage, name: str) -> None:
    """For a person who wants to look at it."""
    if folder := os.environ.get("LOCKSTEP_TEST_PICTURES"):
        await console.page.screenshot(path=Path(folder) / f"{name}.png")


async def test_a_click_is_a_goal_with_the_heading_of_the_drag_and_the_robot_arrives(
    stack: Stack, chromium: Browser
) -> None:
    async with (
        open_console(chromium, stack.operator, width=1366, height=768) as console,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        for _ in range(TRIES):
            await arm_at_rest(console)
            if await console.page.locator(".map-canvas").count() == 0:
                canvas = await open_map(console)
            x, y = await _place(canvas, 1.2, -0.8)
            await console.page.mouse.move(x, y)
            await console.page.mouse.down()
            await console.page.mouse.move(x, y - 60, steps=4)  # north
            await _picture(console, "map-laptop-aim")
            await console.page.mouse.up()
            await expect(_words(console)).to_contain_text(re.compile("Go to: .*m to go|planning|Arm first"))
            await _picture(console, "map-laptop-going")
            await expect(_words(console)).to_contain_text(
                re.compile("done · arrived|cancelled|Arm first"), timeout=30_000
            )
            if "done · arrived" in await _words(console).inner_text():
                break
        else:
            raise AssertionError("the robot does not arrive")
        joints = await console.page.evaluate("lockstep.stats().joints")
        assert math.hypot(joints[0] - 1.2, joints[1] + 0.8) < 0.1
        assert abs(joints[2] - math.pi / 2) < 0.1
        await open_map(observer)
        await expect(observer.page.locator(".map-hint")).to_be_hidden()
    done = await until_logged(stack, "action", lambda record: record["state"] == "done")
    assert done["name"] == "go_to"


async def test_a_place_without_room_is_refused_by_name_and_without_arming_nothing_is_asked(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator, width=1366, height=768) as console:
        await console.until_live()
        canvas = await open_map(console)
        assert await findings(console.page) == []
        await canvas.click(position={"x": 200, "y": 200})
        await expect(console.page.get_by_text("Go to: Arm first: this moves the robot").first).to_be_attached()
        assert not await stack.events("action")
        await arm_at_rest(console)
        x, y = await _place(canvas, -1.8, -1.0)  # a pillar
        await console.page.mouse.click(x, y)
        await expect(_words(console)).to_contain_text("refused · not possible now · there is no room at that place")
        assert await findings(console.page) == []


@pytest.mark.parametrize("how", ["cancel", "stick", "stop", "close"])
async def test_a_goal_ends_with_everything_that_ends_driving(stack: Stack, chromium: Browser, how: str) -> None:
    reasons = {"cancel": "cancelled", "stick": "driving", "stop": "stopped, rested", "close": "rested, link_down"}
    async with open_console(chromium, stack.operator, width=1366, height=768) as console:
        for _ in range(TRIES):
            await arm_at_rest(console)
            if await console.page.locator(".map-canvas").count() == 0:
                canvas = await open_map(console)
            since = (await stack.records())[-1]["time"]
            await console.page.mouse.click(*await _place(canvas, -3.0, 2.0))
            await expect(_words(console)).to_contain_text(re.compile("to go|planning|Arm first|cancelled"))
            if "Arm first" in await _words(console).inner_text():
                continue
            await _end(console, how)
            ended = await _ended(stack, since)
            if ended["state"] == "cancelled" and ended["reason"] in reasons[how].split(", "):
                break
            assert how != "close", ended
        else:
            raise AssertionError(f"a busy machine ended it each time, or nothing did: {how}")
    await until_logged(stack, "feedback", lambda record: record["at_rest"])


async def _end(console: ConsolePage, how: str) -> None:
    match how:
        case "cancel":
            with suppress(Error):  # the goal has ended meanwhile, as the record says: nothing is left to cancel
                await console.page.locator(".map-cancel").click(timeout=5_000)
        case "stick":
            await console.pad.press(RB)
            await console.pad.tilt(1, -0.5)
        case "stop":
            await console.page.get_by_role("button", name="Stop the robot").click()
        case "close":
            await console.page.close()


async def _ended(stack: Stack, since: float) -> dict[str, Any]:
    """The bridge's record of the action that ended after this time, by its clock."""
    return await until_logged(
        stack, "action", lambda record: record["time"] > since and record["state"] not in ("accepted", "running")
    )


async def test_a_finger_that_rests_sets_a_goal_and_one_that_moves_moves_the_map(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator, width=390, height=844, touch=True) as console:
        await console.until_live()
        canvas = await open_map(console)  # in the details, which disarm
        await arm_at_rest(console)
        await _picture(console, "map-phone")
        assert await findings(console.page) == []
        client = await console.page.context.new_cdp_session(console.page)

        async def touch(kind: str, *points: tuple[float, float]) -> None:
            places = [{"x": x, "y": y} for x, y in points]
            await client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

        x, y = await _place(canvas, 1.0, 0.0)
        await touch("touchStart", (x, y))
        await touch("touchMove", (x + 30, y))
        await touch("touchEnd")
        assert not await stack.events("action")
        await console.page.get_by_role("button", name="Whole map").click()
        await touch("touchStart", (x, y))
        await expect(console.page.locator('.map[data-aims="true"]')).to_be_visible()
        await touch("touchMove", (x, y - 40))
        await _picture(console, "map-phone-aim")
        await touch("touchEnd")
        await until_logged(stack, "action", lambda record: record["name"] == "go_to")
        said = console.page.locator(".action-words, .map-words").filter(visible=True, has_text="Go to: ")
        await expect(said).to_have_count(1)  # not twice, one over the other
        await _picture(console, "map-phone-going")
