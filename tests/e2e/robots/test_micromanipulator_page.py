"""The microscope on the page: what is clicked on comes to the middle of the picture, and the tip after it."""

import json
import math
import os
import re
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from playwright.async_api import Browser, Locator

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.robot_bridge.robots.micromanipulator.description import DESCRIPTION, WINDOWS
from tests.client.live.truth import until_logged
from tests.e2e.armed import arm_at_rest
from tests.support.stack import Stack, running_stack

pytestmark = pytest.mark.browser

TRIES = 4  # a busy machine may hold the page up, which disarms it and so cancels the action
ACROSS, DOWN = 0.35, 0.4  # of the picture
PIXEL = 0.5e-6  # m
OFFSET = ((0.5 - DOWN) * 480 * PIXEL, (0.5 - ACROSS) * 640 * PIXEL)  # m, x and y, from what is in the middle
NEAR = 1.5e-6  # m: a click is good to a pixel of the page
MARGIN = 1e-6  # m: the view stays that far from its limits
VIEW = 4  # of the joints, the first of two


async def _click(picture: Locator) -> None:
    box = await picture.bounding_box()
    assert box is not None
    scale = min(box["width"] / 640, box["height"] / 480)
    left = await picture.evaluate("each => parseFloat(getComputedStyle(each).objectPosition) / 100")
    await picture.click(
        position={
            "x": (box["width"] - 640 * scale) * left + ACROSS * 640 * scale,
            "y": (box["height"] - 480 * scale) / 2 + DOWN * 480 * scale,
        }
    )


async def _joints(console: ConsolePage) -> list[float]:
    joints: list[float] = await console.page.evaluate("lockstep.stats().joints")
    return joints


async def _done(
    stack: Stack, console: ConsolePage, name: str, ask: Callable[[], Awaitable[None]]
) -> tuple[list[float], list[float]]:
    """The joints before and after the action; asked for again when a busy machine has cancelled it."""
    for _ in range(TRIES):
        await arm_at_rest(console)
        before, since = await _joints(console), (await stack.records())[-1]["time"]
        await ask()
        await console.until(
            f"!s.armed || s.joints.some((each, number) => Math.abs(each - {json.dumps(before)}[number]) > 1e-6)"
        )
        if not (await console.stats())["armed"]:
            continue
        ended = await until_logged(
            stack,
            "action",
            lambda each, since=since: (  # type: ignore[misc]
                each["time"] > since and each["name"] == name and each["state"] not in ("accepted", "running")
            ),
        )
        if ended["state"] == "done":
            await console.until("s.at_rest === true")
            return before, await _joints(console)
    raise AssertionError(f"{name} never ended well")


async def test_what_is_clicked_on_comes_to_the_middle_of_the_picture_and_the_tip_goes_there(
    tmp_path: Path, chromium: Browser
) -> None:
    async with (
        running_stack(tmp_path, robot="micromanipulator") as stack,
        open_console(chromium, stack.operator, width=1366, height=768) as console,
    ):
        picture = console.page.locator('canvas[data-stream="microscope"]')
        before, after = await _done(stack, console, "centre", lambda: _click(picture))
        for joint, offset in zip((VIEW, VIEW + 1), OFFSET, strict=True):
            end = WINDOWS[DESCRIPTION.joints[joint].name][1] - MARGIN
            assert abs(after[joint] - min(before[joint] + offset, end)) < NEAR
        button = console.page.get_by_role("button", name=re.compile("Tip to the middle")).locator("visible=true")
        _, after = await _done(stack, console, "tip_to_middle", button.first.click)
        assert math.dist(after[:2], after[VIEW:]) < NEAR
        if folder := os.environ.get("LOCKSTEP_TEST_PICTURES"):
            await console.page.screenshot(path=Path(folder) / "microscope.png")
