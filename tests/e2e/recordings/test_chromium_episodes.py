"""The bar of episodes on the operator's page."""

import os
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import RB
from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.server.recording.reading.reader import RecordingReader
from tests.e2e.accessibility import findings
from tests.support.stack import running_stack

pytestmark = pytest.mark.browser

SETTINGS = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "1"}
A, X, LB, RIGHT_STICK, CROSS_UP = 0, 2, 4, 11, 12  # W3C standard mapping
SHOTS = os.environ.get("EPISODE_SHOTS", "")  # directory for pictures of the page, for people to look at


async def _shot(page: Page, name: str) -> None:
    if SHOTS:
        await page.screenshot(path=f"{SHOTS}/{name}.png")


async def _press(console: ConsolePage, button: int) -> None:
    for pressed in (True, False):
        await console.pad.press(button, pressed)


async def test_a_supervisor_begins_and_keeps_episodes_with_keys_and_pad_while_an_operator_drives(
    tmp_path: Path, chromium: Browser
) -> None:
    recordings = tmp_path / "recordings"
    async with (
        running_stack(tmp_path, settings=SETTINGS, extra=("--record", str(recordings))) as stack,
        open_console(chromium, stack.supervisor) as page_console,
        Console(stack.operator, video=False, audio=False) as driver,
    ):
        page = page_console.page
        await page_console.until_live()
        await driver.take_seat()
        bar = page.locator(".episode-bar")
        await expect(bar.locator(".episode-words")).to_have_text("No episode yet")
        await expect(bar.get_by_role("button", name="Keep")).to_be_hidden()
        await _shot(page, "idle")
        assert await findings(page) == []
        await page.keyboard.press("b")
        await expect(bar.locator(".episode-words")).to_have_text("Not done: say in words what is to be done")
        await bar.locator(".episode-task").fill("push the box b k l")  # letters in the field are no keys
        await bar.locator(".episode-task").press("Enter")
        await expect(bar.locator(".episode-words")).to_contain_text("Take 1")
        await _shot(page, "open")
        assert await findings(page) == []
        for _ in range(5):
            await drive_on(driver, [0.2, 0.0, 0.0])
        await page.keyboard.press("y")
        await expect(bar.locator(".episode-count")).to_have_text("1 kept")
        await page.keyboard.press("b")
        await expect(bar.locator(".episode-words")).to_contain_text("Take 2")
        await page.keyboard.press("o")  # again
        await expect(bar.locator(".episode-words")).to_contain_text("Take 3")
        await page.keyboard.press("l")
        await expect(bar.locator(".episode-count")).to_have_text("1 kept · 2 discarded")
        await expect(bar.locator(".episode-words")).to_have_text("Episode 3 is discarded")
        await page_console.pad.press(RIGHT_STICK, True)
        await _press(page_console, A)
        await expect(bar.locator(".episode-words")).to_contain_text("Take 4")
        await page_console.pad.press(RB, True)
        for button in (X, LB):
            await _press(page_console, button)
            await expect(bar.locator(".episode-words")).to_have_text("Not done: let go of the button to hold first")
        await expect(bar.locator(".episode-count")).to_have_text("1 kept · 2 discarded")
        await page_console.pad.press(RB, False)
        await _press(page_console, CROSS_UP)
        for _ in range(3):
            await drive_on(driver, [0.2, 0.0, 0.0])
        await _press(page_console, X)
        await expect(bar.locator(".episode-count")).to_have_text("2 kept · 2 discarded")
        await page_console.pad.press(RIGHT_STICK, False)
        await page.set_viewport_size({"width": 390, "height": 844})
        await _shot(page, "phone-idle")
        await page.keyboard.press("b")
        await expect(bar.locator(".episode-words")).to_contain_text("Take 5")
        await _shot(page, "phone-open")
        assert await findings(page) == []
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert (await page_console.stats())["bad_messages"] == 0
    (path,) = recordings.glob("*.mcap")
    with RecordingReader(path) as reader:
        assert [(each.state, each.outcome, each.task) for each in reader.index.episodes] == [
            ("kept", "success", "push the box b k l"),
            ("discarded", "", "push the box b k l"),
            ("discarded", "", "push the box b k l"),
            ("kept", "failure", "push the box b k l"),
            ("cut", "", "push the box b k l"),
        ]
        assert [text for _, text in reader.index.episodes[3].marks] == ["mark"]


async def test_keys_and_the_button_keep_fail_and_mark_an_episode(tmp_path: Path, chromium: Browser) -> None:
    recordings = tmp_path / "recordings"
    at_once = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0"}
    async with (
        running_stack(tmp_path, settings=at_once, extra=("--record", str(recordings))) as stack,
        open_console(chromium, stack.supervisor) as console,
        Console(stack.operator, video=False, audio=False) as driver,
    ):
        await console.until_live()
        await driver.take_seat()
        bar, keys = console.page.locator(".episode-bar"), console.page.keyboard
        await bar.locator(".episode-task").fill("push the box")
        await bar.locator(".episode-task").press("Enter")
        for number, key in enumerate("kny", 1):
            await expect(bar.locator(".episode-words")).to_contain_text(f"Take {number}")
            for _ in range(3):
                await drive_on(driver, [0.2, 0.0, 0.0])
            if key == "k":
                await keys.press("m")
            elif key == "y":
                await bar.get_by_role("button", name="Mark").click()
            await keys.press(key)
            await expect(bar.locator(".episode-count")).to_have_text(f"{number} kept")
            await keys.press("b")
        await keys.press("l")
    (path,) = recordings.glob("*.mcap")
    with RecordingReader(path) as reader:
        episodes = reader.index.episodes[:3]
    assert [each.outcome for each in episodes] == ["", "failure", "success"]
    assert [[text for _, text in each.marks] for each in episodes] == [["mark"], [], ["mark"]]


async def test_an_observer_sees_no_bar_and_without_a_recording_there_is_none(tmp_path: Path, chromium: Browser) -> None:
    async with running_stack(tmp_path) as stack:
        for link in (stack.supervisor, stack.observer):
            async with open_console(chromium, link) as console:
                await console.until_live()
                await console.page.locator(".settings, .tabs").first.wait_for(state="attached")
                await expect(console.page.locator(".episode-bar")).to_be_hidden()


async def test_an_episode_that_was_open_when_the_console_ended_is_said_to_be_lost(
    tmp_path: Path, chromium: Browser
) -> None:
    record = ("--record", str(tmp_path / "recordings"))
    async with AsyncExitStack() as closing:
        async with running_stack(tmp_path, settings=SETTINGS, extra=record) as first:
            port = int(first.console.rsplit(":", 1)[1])
            page_console = await closing.enter_async_context(open_console(chromium, first.supervisor))
            await page_console.until_live()
            bar = page_console.page.locator(".episode-bar")
            await bar.locator(".episode-task").fill("push the box")
            await bar.locator(".episode-task").press("Enter")
            await expect(bar.locator(".episode-words")).to_contain_text("Take 1")
        await expect(bar.locator(".episode-words")).to_have_text("Take 1: the console does not answer")
        await expect(bar.get_by_role("button", name="Keep")).to_be_hidden()
        await _shot(page_console.page, "console-ended")
        async with running_stack(tmp_path, settings=SETTINGS, extra=record, port=port):
            await expect(bar.locator(".episode-words")).to_have_text(
                "Episode 1 is lost: the console ended", timeout=30_000
            )
            await _shot(page_console.page, "console-again")
