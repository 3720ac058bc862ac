"""The SO-101 on the page: both layers from the keyboard, STOP, and a hand in an emulated headset."""

from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.headset_page import TRIES, Headset, open_headset
from tests.e2e.so101 import SO101, needs_so101
from tests.support.stack import Stack, running_stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240), needs_so101]

TOOL = ["tool.x", "tool.y", "tool.z", "tool.rx", "tool.ry", "tool.rz", "gripper"]
LAPTOP = (1366, 768)
GRIP = [0.2, 1.3, -0.4]  # m, where the hand is


@pytest_asyncio.fixture(loop_scope="session")
async def so101(half_rate: None, tmp_path: Path) -> AsyncIterator[Stack]:
    """Each test's own: from where one leaves the arm, the other cannot lead its tool everywhere."""
    async with running_stack(tmp_path, robot="so101", settings=SO101) as stack:
        yield stack


async def _hold(console: ConsolePage, key: str, reached: str) -> None:
    """Hold the space bar and a key until `reached`; again if a busy machine ended it."""
    keyboard = console.page.keyboard
    for _ in range(TRIES):
        await _arm(console)
        await keyboard.down("Space")
        await keyboard.down(key)
        await console.until(f"!s.armed || ({reached})")
        held = (await console.stats())["armed"]
        await keyboard.up(key)
        await keyboard.up("Space")
        if held:
            await console.until("!s.driving && s.at_rest === true", 30)
            return
    raise AssertionError(f"the keyboard does not drive: {await console.stats()}")


async def _go_home(console: ConsolePage, there: str) -> None:
    """Press Home; again where a busy machine ended it on the way."""
    runs = "document.querySelector('[data-action=home]').dataset.state === 'running'"
    for _ in range(TRIES):
        await _arm(console)
        await console.page.get_by_role("button", name="Home", exact=True).click()
        with suppress(AssertionError):  # it may have ended before anybody looked
            await console.until(runs, 5)
        await console.until(f"({there}) || !({runs})")
        with suppress(AssertionError):  # the last feedback may come after the action's end
            await console.until(there, 5)
            return
    raise AssertionError(f"it does not go home: {await console.stats()}")


async def _arm(console: ConsolePage) -> None:
    if not (await console.stats())["armed"]:
        await console.page.get_by_role("button", name="Arm", exact=True).click()
        await console.until("s.armed")


async def test_the_keyboard_drives_the_tool_and_the_joints_and_a_stop_ends_it(so101: Stack, chromium: Browser) -> None:
    width, height = LAPTOP
    async with open_console(chromium, so101.operator, width=width, height=height, pad=False) as console:
        page = console.page
        await console.until_live()
        frames = page.get_by_role("switch", name="Tool frames")
        await expect(frames).to_be_checked()
        await page.keyboard.press("KeyP")
        await expect(frames).not_to_be_checked()
        await page.reload()
        await console.until_live()
        await expect(frames).not_to_be_checked()  # the browser remembers it
        await page.keyboard.press("KeyP")
        await expect(frames).to_be_checked()
        for axis in TOOL:  # all seven are in view, whole
            await expect(page.locator(f'[data-axis="{axis}"] .goal-slider')).to_be_in_viewport(ratio=1)
        start = (await console.stats())["axes"]
        await _hold(console, "KeyR", f"s.axes['tool.z'] > {start['tool.z'] + 0.02}")
        await _hold(console, "KeyT", f"s.axes.gripper > {start['gripper'] + 0.2}")
        layers = page.get_by_role("group", name="Control layer")
        await layers.get_by_role("button", name="Joints", exact=True).click()
        await console.until("s.layer === 'joints'")
        await _hold(console, "KeyD", "s.axes.shoulder_pan > 0.15")
        here = (await console.stats())["axes"]
        assert here["tool.y"] < start["tool.y"] - 0.02  # the pose follows the joints
        await page.keyboard.press("Escape")
        await console.until("s.stop.stopped && !s.armed && s.at_rest === true")
        await console.reset()
        await console.until("s.at_rest === true && s.goals.shoulder_pan > 0.1")
        await _go_home(console, "Math.abs(s.axes.shoulder_pan) < 0.02 && s.at_rest === true")
        assert not [each for each in await so101.events("refused") if each["reason"] in ("jump", "conflict")]


@pytest.mark.alone  # as in tests/e2e/xr: a view that is drawn too slowly stops the robot
async def test_a_hand_in_a_headset_leads_the_tool_and_closes_the_gripper(so101: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, so101.operator) as headset:
        await headset.enter()
        start = await _axes(headset)
        for _ in range(TRIES):  # a busy machine may end it
            await headset.squeeze(value=0)
            await headset.place("right", GRIP)
            here = await headset.page.evaluate("window.before = lockstep.stats().goals")
            # To the left and up; back where an ended try has led it there, or it would soon be out of reach.
            sign = 1 if here["tool.y"] < start["tool.y"] + 0.02 else -1
            await headset.drive_until("s.driving && s.commanded['tool.x'] !== null")
            await headset.place("right", [GRIP[0] - sign * 0.05, GRIP[1] + sign * 0.04, GRIP[2]])
            reached = (
                f"((b) => Math.abs(s.axes['tool.y'] - b['tool.y'] - {sign * 0.05}) < 0.01"
                f" && Math.abs(s.axes['tool.z'] - b['tool.z'] - {sign * 0.04}) < 0.01)(window.before)"
            )
            await headset.console.until(f"!s.armed || {reached}")
            if await headset.holds(reached):
                break
        else:
            raise AssertionError(f"the hand does not lead the tool: {await headset.console.stats()}")
        await headset.press("right", "trigger")
        await headset.drive_until(f"Math.abs(s.axes.gripper - {start['gripper']}) > 0.2")
        await headset.squeeze(value=0)
        await headset.console.until("!s.armed && s.at_rest === true")
        assert not [each for each in await so101.events("refused") if each["reason"] in ("jump", "conflict")]


async def _axes(headset: Headset) -> dict[str, Any]:
    axes: dict[str, Any] = (await headset.console.stats())["axes"]
    return axes
