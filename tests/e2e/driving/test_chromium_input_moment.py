"""What a hand does leaves the page in the input's own event, and waits for no beat of the page."""

from collections.abc import Awaitable, Callable

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

TRIES = 5  # a busy machine may hold up the robot or the page, which disarms it
PRESSES = 50  # arming's neutral command may be due
WATCH_MESSAGES = """() => {
  const send = RTCDataChannel.prototype.send;
  window.sentNow = [];
  RTCDataChannel.prototype.send = function (data) {
    if (typeof data === "string") window.sentNow.push(JSON.parse(data));
    return send.call(this, data);
  };
  window.sentBy = (action) => {
    const { armed } = window.lockstep.stats();
    window.sentNow = [];
    action();
    return armed ? window.sentNow.map(({ type, values }) => [type, values ?? []]) : null;
  };
}"""
KEY = """([type, code]) => window.sentBy(() => {
  document.body.dispatchEvent(new KeyboardEvent(type, { code, bubbles: true, cancelable: true }));
})"""
LET_GO = """() => {
  for (const code of ["KeyW", "Space"])
    document.body.dispatchEvent(new KeyboardEvent("keyup", { code, bubbles: true, cancelable: true }));
}"""
LATE_KEY = """() => {
  const late = new KeyboardEvent("keydown", { code: "KeyW", bubbles: true, cancelable: true });
  const until = performance.now() + 80;
  while (performance.now() < until);
  return window.sentBy(() => document.body.dispatchEvent(late));
}"""
FINGER = """([type, x, y]) => window.sentBy(() => {
  const stick = document.querySelector(".stick");
  const box = stick.getBoundingClientRect();
  const at = { clientX: box.left + x * box.width, clientY: box.top + y * box.height };
  stick.dispatchEvent(new PointerEvent(type, { pointerId: 1, pointerType: "touch", isPrimary: true, ...at }));
})"""

# By message, what the page sent in the input's own event: its type and values. None: it was not armed before.
Sent = list[tuple[str, list[float]]] | None


async def _arms(console: ConsolePage, code: str = "") -> None:
    """Armed, with the key held if one is named, and so driving."""
    for _ in range(TRIES):
        if not (await console.stats())["armed"]:
            await console.arm_by_key()
        if code:
            await console.page.evaluate(KEY, ["keydown", code])
        await console.until("!s.armed || s.driving" if code else "true")
        if (await console.stats())["armed"]:
            return
        await console.page.evaluate(LET_GO)
    raise AssertionError("it does not stay armed")


async def _may_send(console: ConsolePage) -> None:
    await console.until("!s.armed || s.gate.state === 'open'")


async def _moves(console: ConsolePage, begin: Callable[[int], Awaitable[Sent]]) -> Sent:
    """What was sent by the first that moves the robot; None where the page was disarmed before."""
    sent: Sent = []
    for number in range(PRESSES):
        await _may_send(console)
        sent = await begin(number)
        if sent is None or any(any(values) for _, values in sent):
            break
    return sent


async def test_a_key_drives_and_rests_the_robot_in_its_own_event(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        await console.page.evaluate(WATCH_MESSAGES)

        async def press(_: int) -> Sent:
            await console.page.evaluate(KEY, ["keyup", "KeyW"])
            sent: Sent = await console.page.evaluate(KEY, ["keydown", "KeyW"])
            return sent

        for _ in range(TRIES):
            await _arms(console, "Space")
            sent = await _moves(console, press)
            released = await console.page.evaluate(KEY, ["keyup", "Space"])
            await console.page.evaluate(LET_GO)
            if sent is not None and released is not None:
                break
        assert [(kind, values[0] > 0) for kind, values in sent or []] == [("command", True)]
        assert released[0][0] == "rest"
        assert all(not any(values) for _, values in released)
        await console.until("!s.driving && s.at_rest === true")


async def test_a_key_that_waited_behind_a_busy_page_drives_nothing_in_its_own_event(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        await console.page.evaluate(WATCH_MESSAGES)
        for _ in range(TRIES):
            await _arms(console, "Space")
            sent: Sent = await console.page.evaluate(LATE_KEY)
            assert not sent
            await console.until("!s.armed || window.sentNow.some(({ values }) => values && values[0] > 0)")
            moved = await console.page.evaluate("window.sentNow.some(({ values }) => values && values[0] > 0)")
            await console.page.evaluate(LET_GO)
            if sent is not None and moved:
                return
        raise AssertionError("the key drives nothing at all")


async def test_a_finger_drives_and_rests_the_robot_in_its_own_event(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator, pad=False, touch=True) as console:
        await console.until_live()
        await console.page.evaluate(WATCH_MESSAGES)
        await console.page.evaluate("() => { Element.prototype.setPointerCapture = () => undefined; }")

        async def touch(height: int) -> Sent:
            await console.page.evaluate(FINGER, ["pointerdown", 0.5, 0.5])
            sent: Sent = await console.page.evaluate(FINGER, ["pointermove", 0.5, 0.3 - height / 1000])
            return sent

        for _ in range(TRIES):
            await _arms(console)
            sent = await _moves(console, touch)
            released = await console.page.evaluate(FINGER, ["pointerup", 0.5, 0.5])
            if sent is not None and released is not None:
                break
        assert [(kind, any(values)) for kind, values in sent or []] == [("command", True)]
        assert released[0][0] == "rest"
        await console.until("!s.driving && s.at_rest === true")
