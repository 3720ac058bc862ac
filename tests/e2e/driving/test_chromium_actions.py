"""Actions and status on the page: what moves the robot ends with everything that ends driving."""

import re
from typing import Any

import pytest
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import RB
from tests.client.live.truth import until_logged
from tests.support.stack import Stack

A, X = 0, 2  # the pad's buttons

pytestmark = pytest.mark.browser


# What the page shows of this action from here on, also for a moment: "running", "done".
WATCH_HOME = """() => {
  const home = document.querySelector(".action[data-action=home]");
  window.shown = [];
  window.watching?.disconnect();
  window.watching = new MutationObserver(() => window.shown.push(home.dataset.state));
  window.watching.observe(home, { attributes: true, attributeFilter: ["data-state"] });
}"""
TRIES = 3  # a busy machine may hold the page up, which disarms it and so cancels the action


def _action(console: ConsolePage, name: str) -> Locator:
    return console.page.locator(f'.action[data-action="{name}"]')


def _words(console: ConsolePage) -> Locator:
    return console.page.locator(".action-words")


async def _away(console: ConsolePage) -> None:
    """So far from home that the way back takes a while; armed, with everything let go."""
    await console.until_live()
    for _ in range(TRIES):
        await console.drive_on_until("Math.abs(s.joints?.[0] ?? 0) > 0.4")
        await console.pad.let_go()
        await console.until("s.at_rest === true")
        if (await console.stats())["armed"]:
            await console.page.evaluate(WATCH_HOME)
            return
    raise AssertionError("it does not stay armed")


async def _runs(console: ConsolePage) -> bool:
    """Whether the action that was asked for runs: a page that a busy machine has disarmed asks for none."""
    await console.until("!s.armed || window.shown.includes('running')")
    return bool(await console.page.evaluate("window.shown.includes('running')"))


async def _ended(stack: Stack, since: float) -> dict[str, Any]:
    """The bridge's record of the action that ended after this time."""
    return await until_logged(
        stack, "action", lambda record: record["time"] > since and record["state"] not in ("accepted", "running")
    )


async def _now(stack: Stack) -> float:
    """By the bridge's clock."""
    time: float = (await stack.records())[-1]["time"]
    return time


async def test_home_shows_its_progress_and_leaves_the_keyboard_with_the_robot(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator) as console,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        await observer.until("s.connected && s.event !== null")
        for _ in range(TRIES):
            await _away(console)
            await _action(console, "home").get_by_role("button").click()
            if not await _runs(console):
                continue
            assert await console.page.evaluate("document.activeElement === document.body")
            await expect(_words(observer)).to_contain_text("Home")
            await expect(_words(console)).to_contain_text(re.compile("done · at home|cancelled|Arm first"))
            if "done · at home" in await _words(console).inner_text():
                break
        else:
            raise AssertionError("the robot does not come home")
        await expect(_action(observer, "home")).to_be_hidden()
    done = await until_logged(stack, "action", lambda record: record["state"] == "done")
    assert done["name"] == "home"


async def test_without_arming_a_motion_says_why_not_and_the_light_goes_on(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        home = _action(console, "home").get_by_role("button")
        await expect(home).to_have_attribute("aria-disabled", "true")
        await expect(home).to_have_attribute("title", "Arm first: this moves the robot")
        await home.click(force=True)
        light = console.page.locator('.status-item[data-item="light"] .status-value')
        await _action(console, "light").get_by_role("combobox").select_option("on")
        await _action(console, "light").get_by_role("button").click()
        await expect(light).to_have_text("on")
        await _action(console, "light").get_by_role("combobox").select_option("off")
        await _action(console, "light").get_by_role("button").click()
        await expect(light).to_have_text("off")
        await expect(console.page.locator('.status-item[data-item="battery"]')).to_have_attribute("data-tone", "good")
    assert not [record for record in await stack.events("action") if record["name"] == "home"]


async def test_a_pad_asks_for_nothing_under_a_window_or_in_a_page_that_is_not_in_front(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.page.keyboard.press("h")
        await expect(console.page.get_by_role("dialog")).to_be_visible()
        await console.pad.press(X)
        await console.pad.press(X, False)
        said = console.page.get_by_text("First close the window over the picture")
        await expect(said.first).to_be_attached()
        await console.page.get_by_role("dialog").get_by_role("button", name="Close").click()
        await expect(console.page.get_by_role("dialog")).to_be_hidden()
        await console.page.evaluate("document.hasFocus = () => false")
        await console.pad.press(X)
        await console.pad.press(X, False)
        await expect(console.page.get_by_text("The page is not in front").first).to_be_attached()
        assert not await stack.events("action")
        await console.page.evaluate("document.hasFocus = () => true")
        await console.pad.press(X)
        await console.pad.press(X, False)
        await expect(_action(console, "light")).to_have_attribute("data-state", "done")


@pytest.mark.parametrize("how", ["pad", "key"])
async def test_the_pad_and_the_keyboard_ask_and_cancel_too(stack: Stack, chromium: Browser, how: str) -> None:
    async def ask() -> None:
        if how == "pad":
            await console.pad.press(A)
            await console.pad.press(A, False)
        else:
            await console.page.keyboard.press("1")

    async with open_console(chromium, stack.operator) as console:
        for _ in range(TRIES):
            await _away(console)
            since = await _now(stack)
            await ask()
            if not await _runs(console):
                continue
            await ask()
            if (await _ended(stack, since))["state"] == "cancelled":
                break  # else it was home before
        else:
            raise AssertionError("it was home each time before it was cancelled")
        await expect(_action(console, "home")).to_have_attribute("data-state", "cancelled")


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("cancel", "cancelled"),
        ("stick", "driving"),
        ("disarm", "rested"),
        ("stop", "stopped, rested"),
        ("blur", "rested"),
    ],
)
async def test_what_moves_ends_with_everything_that_ends_driving(
    stack: Stack, chromium: Browser, how: str, reason: str
) -> None:
    async with open_console(chromium, stack.operator) as console:
        for _ in range(TRIES):
            await _away(console)
            since = await _now(stack)
            await _action(console, "home").get_by_role("button").click()
            if not await _runs(console):
                continue
            await _end(console, how)
            ended = await _ended(stack, since)
            await console.pad.press(RB, False)
            await console.pad.tilt(1, 0)
            if ended["state"] == "cancelled":
                break
            if how == "stop":
                await console.until("s.stop.stopped")
                await console.reset()
            await console.page.evaluate("dispatchEvent(new Event('blur'))")  # it may still be armed
            await console.until("!s.armed")
        else:
            raise AssertionError("it was home each time before anything ended it")
        assert ended["reason"] in reason.split(", ")  # a page that stops rests too: whichever is there first


async def _end(console: ConsolePage, how: str) -> None:
    match how:
        case "cancel":
            await _action(console, "home").get_by_role("button").click()
        case "stick":
            await console.pad.press(RB)
            await console.pad.tilt(1, -0.5)
        case "disarm":
            await console.page.get_by_role("button", name="Disarm").click()
        case "stop":
            await console.page.get_by_role("button", name="Stop the robot").click()
        case "blur":
            await console.page.evaluate("dispatchEvent(new Event('blur'))")


async def test_a_page_that_is_gone_leaves_no_motion_behind(stack: Stack, chromium: Browser) -> None:
    for _ in range(TRIES):
        async with open_console(chromium, stack.operator) as console:
            await _away(console)
            since = await _now(stack)
            await _action(console, "home").get_by_role("button").click()
            if not await _runs(console):
                continue
            await console.page.close()
            if (await _ended(stack, since))["state"] == "cancelled":
                return
    raise AssertionError("it was home each time before its page was gone")
