"""STOP from everybody, at any time; reset is the operator's and moves nothing."""

import pytest
from playwright.async_api import Browser

from bench.browsers.console_page import RB, STOP_BUTTON, ConsolePage, open_console
from tests.support.stack import Stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]


async def _stopped(console: ConsolePage) -> None:
    await console.until("s.stop.stopped && !s.armed && s.at_rest === true")


def _executed_after_the_stop(stack: Stack) -> list[int]:
    stop = next(stack.events("stop"))
    return [record["event"] for record in stack.events("executed") if record["time"] > stop["time"]]


async def test_the_stop_button_stops_a_driven_robot_and_it_stays_stopped(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        await console.page.get_by_role("button", name="Stop the robot").click()
        await _stopped(console)
        await console.press(RB, False)
        await console.press(9)
        rendered = (await console.stats())["streams"]["overview"]["rendered"]
        await console.until(f"s.streams.overview.rendered > {rendered + 10}")  # pictures go on while it is stopped
        assert not (await console.stats())["armed"]
    assert _executed_after_the_stop(stack) == []


@pytest.mark.parametrize("key", ["Escape", "Backspace"])
async def test_a_key_stops_without_the_pointer(stack: Stack, chromium: Browser, key: str) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.page.keyboard.press(key)
        await _stopped(console)


async def test_the_pads_stop_button_stops(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.press(STOP_BUTTON)
        await _stopped(console)


async def test_an_observer_stops_what_the_operator_drives(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator) as operator,
        open_console(chromium, stack.observer, pad=False) as observer,
    ):
        await operator.until_live()
        await observer.until_live()
        await operator.arm()
        await operator.drive_forward()
        await observer.page.get_by_role("button", name="Stop the robot").click()
        await _stopped(operator)
        assert (await operator.stats())["stop"]["by"] == "observer"
    assert _executed_after_the_stop(stack) == []


async def test_reset_moves_nothing_and_driving_needs_arming_again(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        await console.page.keyboard.press("Escape")
        await _stopped(console)
        reset = console.page.get_by_role("button", name="Hold to reset")
        box = await reset.bounding_box()
        assert box is not None
        await console.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        await console.page.mouse.down()
        await console.until("!s.stop.stopped")
        await console.page.mouse.up()
        # Deadman and stick are still held as they were.
        rendered = (await console.stats())["streams"]["overview"]["rendered"]
        await console.until(f"s.streams.overview.rendered > {rendered + 15}")
        after = await console.stats()
        assert not after["armed"]
        assert after["at_rest"]
        reset_at = next(stack.events("reset"))["time"]
        moving = [each for each in stack.events("executed") if each["time"] > reset_at and any(each["values"])]
        assert moving == []
        await console.press(RB, False)
        await console.arm()
        await console.press(RB)
        await console.until("s.driving && s.at_rest === false")
