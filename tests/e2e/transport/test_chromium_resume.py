"""A connection that falls silent is shown as silent, and resumes without a reload; nothing is executed twice."""

import asyncio
import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from tests.client.live.truth import until_logged
from tests.support.movable_path import movable_path
from tests.support.stack import Stack

pytestmark = pytest.mark.browser


async def _drives_again(console: ConsolePage, stack: Stack) -> None:
    """The seat is back by itself, and the operator arms and drives; the bridge's log has nothing twice."""
    await console.pad.let_go()
    await console.until("s.connected && s.at_rest === true && s.seat && s.seat.mine")
    async with console.driving():
        event = (await console.stats())["event"]
        await console.until(f"s.event > {event + 5}")
    statistics = await console.stats()
    assert all(stream["violations"] == 0 for stream in statistics["streams"].values())
    assert await console.page.evaluate("window.notReloaded")
    executed = [record["event"] for record in await stack.events("executed")]
    assert len(executed) == len(set(executed)), "an event was executed twice"
    await console.pad.let_go()


async def test_a_silent_console_is_called_silent_and_what_it_measured_last_is_shown_as_old(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.operator) as console:
        page = console.page
        await console.until_live()
        await page.evaluate("window.notReloaded = true")
        await console.arm()
        await console.drive_forward()
        peer = (await console.stats())["peer"]
        with own_stack.frozen_console():
            await expect(page.locator(".bar .chip", has_text="Console")).to_contain_text("silent")
            await expect(page.locator(".plate-title", has_text="Console silent")).to_be_visible()
            await expect(page.locator(".console")).to_have_attribute("data-stale", "true")
            await expect(page.locator(".event")).to_contain_text("The console is silent")
            label = page.locator('[data-view="overview"] .view-detail')
            await expect(label).to_have_text("")  # nobody knows how many events the picture is behind now
            assert (await console.stats())["gate"]["state"] == "console_silent"
            await expect(page.locator(".axis-panel .stale-mark")).to_have_text(re.compile(r"([3-9]|\d\d+) s old"))
            await console.until("Number(getComputedStyle(document.querySelector('.axes')).opacity) < 0.6")
        await expect(page.locator(".console")).to_have_attribute("data-stale", "false")
        await expect(page.locator(".plate-title", has_text="Console silent")).to_be_hidden()
        await expect(label).to_have_text(re.compile("gap [0-9] of 4"))
        # The seat went with the silence; its loss and its return are still on their way.
        await console.until("s.seat && s.seat.mine && s.at_rest === true")
        assert (await console.stats())["peer"] == peer, "the same connection goes on"
        await expect(page.locator(".seat")).to_contain_text("You have control")


@contextmanager
def _suspended_pages() -> Iterator[None]:
    """All pages of the browsers that this test has started stand still, as in a suspended machine."""
    pids = [pid for pid in _descendants(os.getpid()) if "--type=renderer" in _read(Path(f"/proc/{pid}/cmdline"))]
    _signal(pids, signal.SIGSTOP)
    try:
        yield
    finally:
        _signal(pids, signal.SIGCONT)


def _descendants(pid: int) -> Iterator[int]:
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, _read(task).split()):
            yield child
            yield from _descendants(child)


def _read(file: Path) -> str:
    """Empty of a process that has just ended, as those of earlier pages do."""
    try:
        return file.read_text()
    except (FileNotFoundError, ProcessLookupError):
        return ""


def _signal(pids: list[int], number: signal.Signals) -> None:
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, number)


SUSPENDED = 2.0  # s: longer than the console may be silent for a page, shorter than a page for the console's seat
TIMES = 3  # a tick or a message may come first


async def test_a_page_that_was_suspended_while_the_deadman_is_held_moves_nothing_when_it_goes_on(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        for _ in range(TIMES):
            await console.arm()
            await console.drive_forward()
            with _suspended_pages():
                await asyncio.sleep(SUSPENDED)
                await _rests(stack)
                before = await _moved(stack)
            await console.until("!s.armed && s.connected && s.at_rest === true && s.seat && s.seat.mine")
            assert await _moved(stack) == before, "the robot moved on when the page woke up"
            await console.pad.let_go()


async def _rests(stack: Stack) -> None:
    """Until the bridge has answered the last event that moved something with a robot at rest."""
    moved = await _moved(stack)
    await until_logged(stack, "feedback", lambda record: record["at_rest"] and record["event"] >= moved)


async def _moved(stack: Stack) -> int:
    """The last event that moved something."""
    return max(int(record["event"]) for record in await stack.events("executed") if any(record["values"]))


async def test_a_dead_path_is_left_by_an_ice_restart_and_the_same_connection_goes_on(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, "about:blank") as console, movable_path(console.page) as path:
        await console.page.goto(stack.operator)
        await console.until_live()
        await console.page.evaluate("window.notReloaded = true")
        await console.arm()
        await console.drive_forward()
        before = await console.stats()
        with path.restarts_wait():
            path.cut()
            await console.until("!s.armed")
            last = (await console.stats())["event"]  # nothing passes: what is newer comes by the new path
        await console.until(f"s.connected && s.streams.overview.stamp > {last}")
        assert path.restarts == [200]
        after = await console.stats()
        assert (after["peer"], after["epoch"]) == (before["peer"], before["epoch"])
        await _drives_again(console, stack)


async def test_a_restart_that_is_refused_becomes_a_new_connection_at_the_present_event(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, "about:blank") as console, movable_path(console.page) as path:
        await console.page.goto(stack.operator)
        await console.until_live()
        await console.page.evaluate("window.notReloaded = true")
        await console.arm()
        await console.drive_forward()
        before = await console.stats()
        path.refuses_restarts = True
        path.cut()
        await console.until(f"s.connected && s.peer !== {before['peer']!r} && s.event >= {before['event']}")
        assert path.restarts == [422]
        assert (await console.stats())["epoch"] == before["epoch"]
        await _drives_again(console, stack)
