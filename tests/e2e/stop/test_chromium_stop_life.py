"""STOP and RESET of several pages against each other, and while the bridge or all of Lockstep starts anew."""

import asyncio
import os
import signal
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.async_api import Browser, Locator, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from tests.e2e.heard import hears, listen, said
from tests.e2e.tamper import open_tampered
from tests.support.stack import Stack, running_stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]

# A stop that was reset so soon that it shows only in the number; what comes later counts on from there.
PASSING_STOP = """(gap) => new Promise((resolve) => {
  window.offset = (window.offset ?? 0) + 1;
  const shifted = (stop) => ({ ...stop, number: stop.number + window.offset });
  window.tamper = (_, m) => m.type === "feedback" || m.type === "stop_state" ? { ...m, stop: shifted(m.stop) } : m;
  const before = window.lockstep.stats();
  const say = (stopped) => window.say("stop", {
    type: "stop_state", event: before.event,
    stop: { ...before.stop, number: before.stop.number + 1, stopped, by: stopped ? "Ann" : "" },
  });
  if (gap !== null) say(true);
  const release = () => {
    say(false);
    resolve(window.lockstep.stats().armed);
  };
  if (gap === null || gap === 0) release();
  else setTimeout(release, gap);
})"""
SAY_AGAIN = """(press) => fetch("/api/stop", {
  method: "POST",
  headers: {
    Authorization: `Bearer ${new URLSearchParams(location.hash.slice(1)).get("token")}`,
    "Content-Type": "application/json",
  },
  body: JSON.stringify({ reason: "late", press }),
}).then((answer) => answer.json())"""
TRIES = 3  # on a busy machine
COMMANDS = "window.sent.filter((m) => m.type === 'command').length"


def _hold_button(console: ConsolePage) -> Locator:
    return console.page.get_by_role("button", name="Hold to reset")


async def _press_down(console: ConsolePage, button: Locator) -> None:
    await button.hover()
    await console.page.mouse.down()


async def _stops(stack: Stack) -> list[dict[str, Any]]:
    return await stack.events("stop")


@pytest.mark.parametrize("rounds", [1, pytest.param(5, marks=pytest.mark.long)])
async def test_a_held_deadman_ends_disarmed_by_a_stop_that_was_reset_between_two_looks(
    stack: Stack, chromium: Browser, rounds: int
) -> None:
    async with open_tampered(chromium, stack.operator) as console:
        await console.until_live()
        for gap in (None, 0, 1, 2) * rounds:
            await console.arm()
            await console.drive_forward()
            armed = await console.page.evaluate(PASSING_STOP, gap)
            assert armed is False, f"still armed with {gap} ms between the stop and its reset"
            commands = await console.page.evaluate(COMMANDS)
            event = (await console.stats())["event"]
            await console.until("s.at_rest === true")
            # Deadman and stick are held as before; nothing is sent, not even the neutral that lets the robot move.
            rendered = (await console.stats())["streams"]["overview"]["rendered"]
            await console.until(f"s.streams.overview.rendered > {rendered + 6}")
            assert await console.page.evaluate(COMMANDS) == commands
            assert (await console.stats())["event"] - event <= 1, "the command that was in flight at most"
            await console.pad.let_go()


async def test_a_hand_that_is_on_reset_does_not_release_the_stop_that_another_page_presses_meanwhile(
    stack: Stack, chromium: Browser
) -> None:
    async with (
        open_console(chromium, stack.operator) as operator,
        open_console(chromium, stack.supervisor, pad=False) as supervisor,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        for page in (operator, supervisor, observer):
            await page.until("s.connected && s.event !== null")
        await operator.until("s.seat.mine")
        await listen(operator)
        for _ in range(TRIES):
            first = await _held_while_another_presses(operator, observer)
            if not [each for each in await stack.events("reset") if each["number"] == first]:
                break  # else a busy machine held the other's press up for the second that a reset takes
            await operator.until("s.stop.stopped")
        else:
            raise AssertionError("the other's press never comes while the hand is on the button")
        await hears(operator, "Look first")  # it says so for a second
        assert (await operator.stats())["stop"]["stopped"]
        await supervisor.until(f"s.stop.number === {first + 2}")
        await supervisor.reset()
        await operator.until("!s.stop.stopped && s.stop_press === null")
        await observer.until("!s.stop.stopped && s.stop_press === null")
        assert not (await operator.stats())["armed"]
    assert [each["number"] for each in await _stops(stack)][-3:] == [first, first + 1, first + 2]
    released = [each["number"] for each in await stack.events("reset") if each["number"] >= first]
    assert released == [first + 2]


async def _held_while_another_presses(operator: ConsolePage, observer: ConsolePage) -> int:
    """Return the number of the operator's stop, for whose reset their hand is on the button meanwhile."""
    await operator.page.keyboard.press("Escape")
    await operator.until("s.stop.stopped && s.stop_press === 'confirmed'")
    first: int = (await operator.stats())["stop"]["number"]
    await observer.until(f"s.stop.number === {first}")
    await observer.page.locator(".plate").get_by_text("who has control, or a supervisor can reset it").wait_for()
    await expect(_hold_button(observer)).to_have_count(0)
    await _hold_button(operator).wait_for()
    await _press_down(operator, _hold_button(operator))
    await observer.page.keyboard.press("Escape")
    await observer.page.keyboard.press("Escape")
    await operator.until(f"s.stop.number === {first + 2}")
    await operator.page.mouse.up()
    return first


async def test_a_stop_is_one_stop_on_all_ways_and_does_not_come_again_after_its_reset(
    stack: Stack, chromium: Browser
) -> None:
    async with open_tampered(chromium, stack.operator) as console:
        await console.until_live()
        await console.page.evaluate("void (window.tamper = (_, m) => m.type === 'stop_taken' ? null : m)")
        await console.page.keyboard.press("Escape")
        await console.until("s.stop.stopped && s.stop_press === 'confirmed'")
        presses = "window.sent.filter((m) => m.type === 'stop').map((m) => m.press)"
        sent = await console.page.evaluate(presses)
        assert len(sent) >= 2
        assert len(set(sent)) == 1
        assert len(sent[0]) == 32
        await console.reset()
        await console.page.evaluate(SAY_AGAIN, sent[0])
        assert not (await console.stats())["stop"]["stopped"]
        assert len(await _stops(stack)) == 1


async def test_a_stop_while_the_bridge_is_away_is_kept_and_confirmed_when_it_is_back(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.observer, pad=False) as observer:
        await observer.until("s.connected && s.event !== null")
        with own_stack.frozen_bridge():
            await observer.page.get_by_text("Robot unreachable").first.wait_for()
            await observer.page.keyboard.press("Escape")
            await observer.until("s.stop_press === 'waiting'")
            await observer.page.locator(".alarm").get_by_text("has not reached the robot").wait_for()
            os.kill(own_stack.bridge_pid(), signal.SIGKILL)
        await observer.until("s.stop.stopped && s.stop_press === 'confirmed'", 60)
        await observer.page.locator(".alarm").wait_for(state="hidden")
    assert await _stops(own_stack)


async def test_before_the_robot_shows_a_stop_the_page_says_that_it_was_pressed_and_not_that_the_robot_is_stopped(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, own_stack.operator) as console:
        await console.until("s.seat && s.seat.mine && s.event !== null")
        await listen(console)
        with own_stack.frozen_bridge():
            await console.page.keyboard.press("Escape")
            await console.until("s.stop_press === 'waiting'")
            await hears(console, "You pressed STOP")
            assert "is stopped" not in await said(console)
        await console.until("s.stop.stopped && s.stop_press === 'confirmed'", 60)


async def test_a_stop_that_the_robot_writes_to_its_disk_is_not_said_to_be_lost(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator, pad=False) as operator,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        for page in (operator, observer):
            await page.until("s.connected && s.event !== null")
            await listen(page)
        for _ in range(10):
            await observer.page.keyboard.press("Escape")
            await observer.until("s.stop.stopped && s.stop_press === 'confirmed' && s.stop.kept")
        for page in (operator, observer):
            await hears(page, "STOPPED")
            told = await said(page)
            assert "save" not in told
            assert "not kept" not in told


async def test_a_stop_while_all_of_lockstep_restarts_holds_when_it_is_back(tmp_path: Path, chromium: Browser) -> None:
    async with running_stack(tmp_path) as first:
        port = urlsplit(first.console).port or 0
        context = open_console(chromium, first.operator, pad=False)
        operator = await context.__aenter__()
        await operator.until("s.connected && s.event !== null")
        await operator.page.keyboard.press("Escape")
        await operator.until("s.stop.stopped && s.stop_press === 'confirmed'")
        number = (await operator.stats())["stop"]["number"]
    try:
        await operator.until("!s.connected")
        await operator.page.keyboard.press("Escape")
        await operator.until("s.stop_press === 'unconfirmed'")
        async with running_stack(tmp_path, port=port):
            await operator.until(f"s.connected && s.stop.stopped && s.stop.number > {number}", 60)
            await operator.until("s.stop_press === 'confirmed'")
            await asyncio.gather(operator.until("s.seat && s.seat.mine"), operator.reset())
            await operator.until("!s.stop.stopped && !s.armed")
    finally:
        await context.__aexit__(None, None, None)
