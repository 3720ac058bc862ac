"""Driving in an emulated headset: sessions, squeeze, sticks, STOP, and every end of a hand's hold on the robot.

The window's own frames are silent and its document is hidden during each session, as in a headset.
"""

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.headset_page import HELD_UP, TRIES, Headset, open_headset
from tests.support.stack import Stack

# A headset that stands still for 0.3 s stops the robot; this machine draws its view for longer beside other work.
pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.timeout(240)]


async def _ends(headset: Headset, words: str) -> None:
    """The page is disarmed, the robot at rest, and the view says why."""
    await headset.console.until("!s.armed && s.at_rest === true && s.headset.held.length === 0")
    await headset.console.until(f"s.headset.text.includes({words!r})")


async def test_a_session_takes_the_page_over_and_gives_it_back(stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await headset.enter()
        entered = await console.stats()
        assert (entered["headset"]["mode"], entered["headset"]["visibility"]) == ("immersive-vr", "visible")
        assert [panel["left"] for panel in entered["headset"]["panels"]] == ["overview", "front"]
        # The window is silent and hidden; the page goes on: pictures are drawn and judged, and sound is heard.
        shown = entered["streams"]["overview"]["rendered"]
        await headset.drive()
        await console.until(f"s.streams.overview.rendered > {shown + 5} && s.sound === 'on'")
        drawn = "document.querySelector('.arm').dataset.state"
        await console.until(f"{drawn} === (s.driving ? 'driving' : 'disarmed')")
        await headset.squeeze(value=0)
        await _ends(headset, "Squeeze the grip to drive")
        await headset.leave()
        await console.arm()
        await console.drive_forward()
        await console.pad.let_go()
        await console.until("s.at_rest === true")


async def test_a_squeeze_holds_to_run_and_the_sticks_drive_what_the_layer_binds(
    stack: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await console.until("s.seat && s.seat.mine")
        await headset.enter()
        await headset.tilt("left", 0, -1)
        await headset.do("h.seen()")
        assert not (await console.stats())["armed"]
        await headset.drive_until("s.axes['base.vx'] > 0.2")
        await headset.drive()
        await headset.drive_until("s.axes['base.wz'] > 0.2 && s.axes['base.vx'] === 0")
        await headset.squeeze(value=0)
        await _ends(headset, "Squeeze the grip to drive")
        # First a neutral command after each squeeze: nothing moves by the one that arms.
        executed = [any(record["values"]) for record in await stack.events("executed")]
        assert executed[0] is False


async def test_a_grip_that_is_held_when_the_session_begins_arms_nothing(stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await console.until("s.seat && s.seat.mine")
        await headset.page.evaluate("testHeadset.device.controllers.right.setButtonValueImmediate('squeeze', 1)")
        await headset.enter()
        await headset.tilt("left", 0, -1)
        await headset.do("h.seen()")
        assert not (await console.stats())["armed"]
        await headset.squeeze(value=0)
        await headset.drive()


DOUBTS = (
    ("h.lost.add('right')", "h.lost.clear()", "lost sight of the hand"),
    ("h.guessed.add('right')", "h.guessed.clear()", "lost sight of the hand"),
    ("h.lost.add('viewer')", "h.lost.clear()", "lost sight of the hand"),
    ("(h.right.connected = false)", "(h.right.connected = true)", "lost sight of the hand"),
    ("h.right.position.set(2, 1, 1)", "h.right.position.set(0.2, 1.3, -0.4)", "lost sight of the hand"),
    ("h.device.recenter()", "null", "lost sight of the hand"),
    ("h.visibility('visible-blurred')", "h.visibility('visible')", "showed something else"),
    ("h.visibility('hidden')", "h.visibility('visible')", "taken off"),
    ("h.lowBattery(true)", "h.lowBattery(false)", "battery is almost empty"),
    ("h.standStill(true)", "h.standStill(false)", "stood still"),
)


async def _ends_by(headset: Headset, what: str, undo: str, words: str) -> None:
    """Drive, do it, and look whether that has ended driving; again if a busy machine did."""
    console = headset.console
    for _ in range(TRIES):
        await headset.drive()
        await headset.do(f"void {what}")
        await console.until("!s.armed && s.at_rest === true")
        await headset.do(f"void {undo}")
        await console.until("s.headset.state === 'Disarmed' && s.headset.text !== ''")
        await headset.squeeze(value=0)
        if words in (text := (await console.stats())["headset"]["text"]):
            return
        assert any(why in text.casefold() for why in HELD_UP), (what, text)
    raise AssertionError(f"a busy machine ended it each time: {what}")


@pytest.mark.timeout(600)
async def test_what_leaves_a_doubt_brings_the_robot_to_rest_by_name(stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        await headset.enter()
        for what, undo, words in DOUBTS:
            await _ends_by(headset, what, undo, words)


async def test_pictures_are_judged_on_while_a_session_has_no_frames(stack: Stack, chromium: Browser) -> None:
    """The window may be seen beside it: a picture that stood there would be too old, without its veil."""
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await headset.enter()
        await headset.do("void h.standStill(true)")
        shown = (await console.stats())["streams"]["overview"]["rendered"]
        await console.until(f"s.streams.overview.rendered > {shown + 5}")
        await headset.do("void h.standStill(false)")
        await headset.drive()


@pytest.mark.parametrize("where", ["getPose", "getViewerPose"])
async def test_a_fault_in_a_frame_of_the_session_gives_the_page_back(
    where: str, stack: Stack, chromium: Browser
) -> None:
    """No frame follows it, so that STOP would be out of reach. The viewer's pose is asked for by what draws, first."""
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await headset.enter()
        await headset.drive()
        await headset.page.evaluate(f"void (XRFrame.prototype.{where} = () => {{ throw new Error('a fault'); }})")
        await headset.page.evaluate("testHeadset.silence(false)")
        await console.until("s.headset === null && !s.armed && s.at_rest === true")
        shown = (await console.stats())["streams"]["overview"]["rendered"]
        await console.until(f"s.streams.overview.rendered > {shown + 5}")


async def test_a_session_whose_view_does_not_load_ends(stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await headset.page.route("**/headset_session*", lambda route: route.abort())
        await headset.page.get_by_role("button", name="Enter VR").first.click()
        await console.until("!window.testHeadset.device.activeSession && s.headset === null")
        await console.arm()


TWO_FRAMES = "new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))"


async def _closes_by(headset: Headset, what: str) -> None:
    """Drive and do it: the session ends, the robot rests, and the page says why; again if a busy machine was first."""
    console, page = headset.console, headset.page
    for _ in range(TRIES):
        await headset.enter()
        await headset.drive()
        await headset.do(f"void {what}")
        await console.until("s.headset === null && !s.armed && s.at_rest === true")
        await page.evaluate("testHeadset.silence(false)")
        await page.evaluate(TWO_FRAMES)
        await console.until("document.querySelector('.arm').dataset.state === 'disarmed'")
        words = (await page.locator(".arm-words").inner_text()).casefold()
        if "headset view was closed" in words:
            return
        assert any(why in words for why in HELD_UP), words
    raise AssertionError(f"a busy machine ended it each time: {what}")


async def test_a_session_that_ends_brings_the_robot_to_rest(stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        await _closes_by(headset, "h.end()")


async def test_a_view_that_cannot_be_drawn_any_more_ends_its_session_and_the_robot_rests(
    stack: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        # Said, and not done: the emulator itself does not bear it.
        await _closes_by(headset, "h.device.appCanvas.dispatchEvent(new Event('webglcontextlost'))")


async def _press_stop(headset: Headset, how: str) -> None:
    if how == "button":
        await headset.press("left", "y-button")
        await headset.press("left", "y-button", 0)
    elif how == "key":
        await headset.page.keyboard.press("Escape")
    else:
        await headset.point("left", "stop")
        await headset.press("left", "trigger")
        await headset.press("left", "trigger", 0)


async def test_stop_is_pressed_in_the_headset_and_reset_there(stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await headset.enter()
        for how in ("button", "key", "ray"):
            await headset.drive()
            await _press_stop(headset, how)
            await console.until("s.stop.stopped && !s.armed && s.at_rest === true && s.headset.state === 'Stopped'")
            await headset.point("left", "reset")
            await headset.press("left", "trigger")  # let go too early
            await headset.press("left", "trigger", 0)
            assert (await console.stats())["stop"]["stopped"]
            await console.until("s.headset.reset === 'Hold to reset'")
            await headset.press("left", "trigger")
            await console.until("!s.stop.stopped")
            await headset.press("left", "trigger", 0)
        await headset.drive()
        # The trigger of a hand that drives is the gripper's: there is nothing to press but STOP, wherever it points.
        await headset.aim("right", "leave")
        await headset.drive_until("s.driving && s.headset.pointed.right === null")
        await headset.squeeze(value=0)
        await console.until("s.headset.pointed.right === 'leave'")
        # `press` waits for frames, and there are none after the session.
        await headset.page.evaluate("testHeadset.device.controllers.right.updateButtonValue('trigger', 1)")
        await console.until("s.headset === null")


async def test_a_contact_is_felt_in_the_hand_that_drives(own_stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, own_stack.operator) as headset:
        await headset.enter()
        await headset.drive(ahead=1)
        await headset.drive_until("testHeadset.pulses.some(({ side, value }) => side === 'right' && value > 0)")
        await headset.squeeze(value=0)
        await _ends(headset, "Squeeze the grip to drive")
        assert not await headset.do("h.pulses.some(({ side, value }) => side === 'left' && value > 0)")
