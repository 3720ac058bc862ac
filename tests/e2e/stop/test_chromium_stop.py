"""STOP from everybody, at any time; reset is the operator's and moves nothing."""

import pytest
from playwright.async_api import Browser, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import RB, STOP_BUTTON
from lockstep.server.scene.page import HOOK
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

# Takes the focus as viser does.
SCENE = f'<html>{HOOK.decode()}</head><input style="margin: 30vh 30vw"></html>'

# Whether nothing of the button is off the screen or below something else.
WHOLE = """() => {
  const stop = document.querySelector("button.stop");
  const { left, right, top, bottom } = stop.getBoundingClientRect();
  const points = [left + 12, (left + right) / 2, right - 12].flatMap((x) => [[x, top + 12], [x, bottom - 12]]);
  const onScreen = left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
  return onScreen && points.every(([x, y]) => stop.contains(document.elementFromPoint(x, y)));
}"""


async def _stopped(console: ConsolePage) -> None:
    await console.until("s.stop.stopped && !s.armed && s.at_rest === true")


async def _executed_after_the_stop(stack: Stack) -> list[int]:
    """Events executed between a stop and its reset."""
    found: list[int] = []
    stopped = False
    for record in await stack.records():
        if record["kind"] in ("stop", "reset"):
            stopped = record["kind"] == "stop"
        elif record["kind"] == "executed" and stopped:
            found.append(record["event"])
    return found


async def test_the_stop_button_stops_a_driven_robot_and_it_stays_stopped(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        await console.page.get_by_role("button", name="Stop the robot").click()
        await _stopped(console)
        await console.pad.press(RB, False)
        await console.pad.press(9)
        rendered = (await console.stats())["streams"]["overview"]["rendered"]
        await console.until(f"s.streams.overview.rendered > {rendered + 10}")  # pictures go on while it is stopped
        assert not (await console.stats())["armed"]
    assert await _executed_after_the_stop(stack) == []


@pytest.mark.parametrize("key", ["Escape", "Backspace"])
async def test_a_key_stops_without_the_pointer(stack: Stack, chromium: Browser, key: str) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.page.keyboard.press(key)
        await _stopped(console)


async def test_the_pads_stop_button_stops(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.pad.press(STOP_BUTTON)
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
    assert await _executed_after_the_stop(stack) == []


async def _press_key(observer: ConsolePage) -> None:
    await observer.page.keyboard.press("Escape")


async def _press_pad(observer: ConsolePage) -> None:
    await observer.pad.press(STOP_BUTTON)


async def _press_button(observer: ConsolePage) -> None:
    await observer.page.get_by_role("button", name="Stop the robot").click()


async def _ask_over_http(observer: ConsolePage) -> None:
    """As the page does when nothing else works: its own token, no data channel."""
    await observer.page.evaluate(
        """() => fetch("/api/stop", {
          method: "POST",
          headers: {
            Authorization: `Bearer ${new URLSearchParams(location.hash.slice(1)).get("token")}`,
            "Content-Type": "application/json",
          },
          body: JSON.stringify({ reason: "from outside" }),
        }).then((answer) => { if (!answer.ok) throw new Error(`${answer.status}`); })"""
    )


async def test_an_observer_stops_by_key_pad_button_and_http_and_all_see_who_and_why(
    stack: Stack, chromium: Browser
) -> None:
    async with (
        open_console(chromium, stack.operator) as operator,
        open_console(chromium, stack.observer) as observer,
    ):
        await operator.until_live()
        await observer.until("s.connected && s.event !== null")
        for way, reason in (
            (_press_key, "stop key"),
            (_press_pad, "stop key"),
            (_press_button, "stop button"),
            (_ask_over_http, "from outside"),
        ):
            await operator.arm()
            await operator.drive_forward()
            await way(observer)
            await _stopped(operator)
            for console in (operator, observer):
                await console.page.locator(".plate").get_by_text(f"By observer: {reason}").wait_for()
            await observer.pad.press(STOP_BUTTON, False)
            await operator.pad.press(RB, False)
            await operator.reset()
    assert await _executed_after_the_stop(stack) == []


async def test_a_supervisor_stops_and_resets_what_an_operator_drives(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator) as operator,
        open_console(chromium, stack.supervisor, pad=False) as supervisor,
    ):
        await operator.until_live()
        await supervisor.until("s.connected && s.event !== null")
        await operator.arm()
        await operator.drive_forward()
        await supervisor.page.keyboard.press("Escape")
        await _stopped(operator)
        await supervisor.reset()
        await operator.until("!s.stop.stopped")
        assert not (await operator.stats())["armed"]


async def test_stop_works_while_a_dialogue_is_open_and_says_so_above_it(stack: Stack, chromium: Browser) -> None:
    async with (
        open_console(chromium, stack.operator, pad=False) as operator,
        open_console(chromium, stack.observer + "&name=Dee", pad=False) as observer,
    ):
        await operator.until("s.connected && s.seat && s.seat.mine")
        await operator.page.get_by_role("tab", name="People").click()
        await operator.page.get_by_text("Dee", exact=True).wait_for()
        await operator.page.get_by_role("button", name="Invite…").click()
        dialogue = operator.page.get_by_role("dialog")
        await dialogue.get_by_label("Name").fill("half written")
        await observer.page.get_by_role("button", name="Stop the robot").click()
        await operator.until("s.stop.stopped")
        await operator.page.locator(".banner").get_by_text("Stopped by Dee").wait_for()
        await expect(dialogue).to_be_visible()
        await dialogue.get_by_role("button", name="Close").click()
        await operator.reset()
        await operator.page.get_by_role("button", name="Invite…").click()
        await operator.page.get_by_role("button", name="Stop the robot").click()
        await operator.until("s.stop.stopped")
        await dialogue.get_by_role("button", name="Close").click()
        await operator.reset()
        await operator.page.get_by_role("button", name="Invite…").click()
        await dialogue.get_by_label("Name").fill("half written")
        await operator.page.keyboard.press("Escape")
        await operator.until("s.stop.stopped")
        await expect(dialogue, "Escape also closes it: the stop is to be seen").to_have_count(0)


async def test_a_stop_key_works_inside_the_3d_scene(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.observer, pad=False) as observer:
        # Drawing the real scene takes so long on a busy machine that the page gives it up.
        await observer.page.route("**/scene/**", lambda route: route.fulfill(body=SCENE, content_type="text/html"))
        await observer.until_live()
        await observer.open_full_scene()
        await observer.page.frame_locator("iframe").locator("input").click()
        assert await observer.page.evaluate("document.activeElement.tagName") == "IFRAME"
        await observer.page.keyboard.press("Escape")
        await observer.until("s.stop.stopped")


@pytest.mark.parametrize(
    ("width", "height"), [(390, 844), (667, 375), (640, 400), (320, 256)], ids=["phone", "turned", "200 %", "400 %"]
)
async def test_stop_is_whole_and_above_everything_on_small_screens_and_zoomed_pages(
    stack: Stack, chromium: Browser, width: int, height: int
) -> None:
    async with open_console(chromium, stack.observer, pad=False, width=width, height=height) as observer:
        await observer.until("s.connected && s.event !== null")
        for stopped in (False, True):  # the second time there is a plate that says so
            assert (await observer.stats())["stop"]["stopped"] is stopped
            assert await observer.page.evaluate(WHOLE)
            await observer.page.get_by_role("button", name="Stop the robot").click()
            await observer.until("s.stop.stopped && s.stop_press === 'confirmed'")
            await observer.page.locator(".plate").get_by_text("Stopped", exact=True).wait_for()


async def test_reset_moves_nothing_and_driving_needs_arming_again(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        await console.page.keyboard.press("Escape")
        await _stopped(console)
        await console.reset()
        # Deadman and stick are still held as they were.
        rendered = (await console.stats())["streams"]["overview"]["rendered"]
        await console.until(f"s.streams.overview.rendered > {rendered + 15}")
        after = await console.stats()
        assert not after["armed"]
        assert after["at_rest"]
        reset_at = (await stack.events("reset"))[0]["time"]
        moving = [each for each in await stack.events("executed") if each["time"] > reset_at and any(each["values"])]
        assert moving == []
        await console.pad.press(RB, False)
        await console.arm()
        await console.drive_forward()
