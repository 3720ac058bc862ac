"""A policy drives, and a person at the page lets it, takes over by button, key and pad, and gives back."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import START
from lockstep.client import CommandRefused, Console
from tests.client.live.test_policies import policy_link
from tests.e2e.accessibility import findings
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

POLICY = {"base.vx": 0.2}


@asynccontextmanager
async def _policy(stack: Stack) -> AsyncIterator[Console]:
    """A policy that drives in each turn that a person gives, and says what it would do meanwhile."""
    async with (
        AsyncExitStack() as tasks,
        Console(await policy_link(stack, "net"), video=False, audio=False, name="net") as console,
    ):
        for run in (_drive(console), _shadow(console)):
            task = asyncio.create_task(run)
            tasks.callback(task.cancel)
        yield console


async def _drive(console: Console) -> None:
    while True:
        await console.policies.seat()
        try:
            await console.arm()
            while True:
                await console.drive(POLICY)
        except CommandRefused:
            if console.seat.holder == console.peer:
                console.release_seat()


async def _shadow(console: Console) -> None:
    async for feedback in console.feedbacks():
        if console.seat.kind == "human":
            console.policies.shadow(POLICY, feedback)


def _bar(console: ConsolePage) -> Locator:
    return console.page.get_by_role("region", name="Policies")


async def _policy_drives(console: ConsolePage) -> None:
    await expect(_bar(console).get_by_text("Policy net drives")).to_be_visible()
    await console.until("s.at_rest === false")


async def test_a_person_lets_a_policy_drive_and_takes_over_by_button_key_and_pad(
    stack: Stack, chromium: Browser, tmp_path: Path
) -> None:
    async with _policy(stack), open_console(chromium, stack.operator + "&name=Ada") as ada:
        await ada.until_live()
        await ada.until("s.seat.mine")
        give = _bar(ada).get_by_role("button", name="Give to net")
        await expect(give).to_be_visible()
        await ada.page.screenshot(path=tmp_path / "ready.png")
        assert await findings(ada.page) == []
        await give.click()
        await _policy_drives(ada)
        assert await findings(ada.page) == []
        await ada.page.screenshot(path=tmp_path / "drives.png")
        await _bar(ada).get_by_role("button", name="Take over").click()
        await ada.until("s.seat.mine && !s.armed && s.at_rest === true")
        for press in ("F8", "Enter"):
            await ada.page.keyboard.press("F2")
            await _policy_drives(ada)
            await ada.page.keyboard.press(press)
            await ada.until("s.seat.mine && !s.armed && s.at_rest === true")
        await ada.page.keyboard.press("F2")
        await _policy_drives(ada)
        for pressed in (True, False):
            await ada.pad.press(START, pressed)
        await ada.until("s.seat.mine && !s.armed && s.at_rest === true")
        await ada.arm()
        await ada.drive_forward()
        await expect(ada.page.get_by_label("What shadow policies want")).to_contain_text("net")
        await ada.page.screenshot(path=tmp_path / "shadow.png")
        assert await findings(ada.page) == []
