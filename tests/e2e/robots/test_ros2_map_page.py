"""From a click on the page's map to a planner over DDS and back: Chromium, a real action server and a real base."""

import math
import os
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from tests.e2e.armed import arm_at_rest
from tests.e2e.map_page import open_map, place_on_map
from tests.support.ros2 import (
    ACTIONS,
    EXAMPLES,
    RosRobot,
    built_interfaces,
    have_compiler,
    have_ros,
    ros_python,
    running_ros_robot,
)
from tests.support.stack import Stack, running_stack

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine"),
    pytest.mark.skipif(not have_compiler(), reason="there is no compiler for the interfaces that no wheel has"),
]

TRIES = 3  # a busy machine may hold the page up, which disarms it and so cancels the goal
SIZE = (8.0, 6.0)  # m, of the node's map, whose middle is its (0, 0)
ODOMETRY = (1.0, -0.5)  # its frame in that of the map


@pytest_asyncio.fixture(loop_scope="session")
async def node(tmp_path: Path) -> AsyncIterator[RosRobot]:
    async with running_ros_robot(tmp_path, ACTIONS, interfaces=built_interfaces()) as robot:
        yield robot


@pytest_asyncio.fixture(loop_scope="session")
async def base(tmp_path: Path, node: RosRobot) -> AsyncIterator[Stack]:
    settings = tmp_path / "base.yaml"
    settings.write_text((EXAMPLES / "base.yaml").read_text() + "\nwatchdog: 0.25\nmap:\n  goal: {}\n")
    extra = ("--ros2", str(settings), "--robot-python", ros_python())
    async with running_stack(tmp_path, extra=extra, settings=node.environment) as stack:
        yield stack


def _words(console: ConsolePage) -> Locator:
    return console.page.locator(".map-words")


async def _place(console: ConsolePage) -> tuple[float, float]:
    """Where the base is on the map."""
    x, y, _ = await console.page.evaluate("lockstep.stats().joints")
    return x + ODOMETRY[0], y + ODOMETRY[1]


async def _send_to(console: ConsolePage, canvas: Locator, x: float, y: float) -> bool:
    """Click until the planner has taken the goal; return whether it still runs."""
    for _ in range(TRIES):
        await arm_at_rest(console)
        await console.page.mouse.click(*await place_on_map(canvas, x, y, SIZE))
        await expect(_words(console)).to_contain_text(re.compile("to go|planning|done|Arm first|cancelled|failed"))
        if re.search("to go|planning|done", await _words(console).inner_text()):
            return True
    return False


async def test_a_click_on_the_map_is_a_goal_of_the_planner_and_stop_cancels_it_there(
    base: Stack, node: RosRobot, chromium: Browser
) -> None:
    async with open_console(chromium, base.operator, width=1366, height=768) as console:
        await console.until_live()
        canvas = await open_map(console)
        x, y = 2.5, 0.5
        for _ in range(TRIES):
            assert await _send_to(console, canvas, x, y)
            if folder := os.environ.get("LOCKSTEP_TEST_PICTURES"):
                await console.page.screenshot(path=Path(folder) / "ros2-map.png")
            await expect(_words(console)).to_contain_text(re.compile("done|cancelled|failed"), timeout=30_000)
            if "done" in await _words(console).inner_text():
                break
        else:
            raise AssertionError("the robot does not arrive")
        *_, asked = node.notes("navigate")
        assert asked["frame"] == "map"
        assert (asked["x"], asked["y"]) == pytest.approx((x, y), abs=0.05), "where the click was"
        assert math.dist(await _place(console), (x, y)) < 0.15

        ended = len(list(node.notes("ended")))
        assert await _send_to(console, canvas, -3.0, 2.0)
        await console.until("s.at_rest === false", 10)
        await console.page.get_by_role("button", name="Stop the robot").click()
        notes = await node.noted("ended", lambda found: len(found) > ended)
        assert notes[-1]["how"] == "canceled"
        await console.until("s.at_rest === true")
        assert math.dist(await _place(console), (-3.0, 2.0)) > 1.0
