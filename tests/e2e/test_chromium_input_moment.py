"""What a hand does leaves the page in the input's own event, and waits for no beat of the page."""

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import open_console
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

TRIES = 50
WATCH_MESSAGES = """() => {
  const send = RTCDataChannel.prototype.send;
  window.sentNow = [];
  RTCDataChannel.prototype.send = function (data) {
    if (typeof data === "string") window.sentNow.push(JSON.parse(data));
    return send.call(this, data);
  };
  window.sentBy = (action) => {
    window.sentNow = [];
    action();
    return window.sentNow.map(({ type, values }) => [type, values ?? []]);
  };
}"""
KEY = """([type, code]) => window.sentBy(() => {
  document.body.dispatchEvent(new KeyboardEvent(type, { code, bubbles: true, cancelable: true }));
})"""
FINGER = """([type, x, y]) => window.sentBy(() => {
  const stick = document.querySelector(".stick");
  const box = stick.getBoundingClientRect();
  const at = { clientX: box.left + x * box.width, clientY: box.top + y * box.height };
  stick.dispatchEvent(new PointerEvent(type, { pointerId: 1, pointerType: "touch", isPrimary: true, ...at }));
})"""


async def test_a_key_drives_and_rests_the_robot_in_its_own_event(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        await console.until("s.seat && s.seat.mine")
        await console.page.keyboard.press("Enter")
        await console.until("s.armed")
        await console.page.evaluate(WATCH_MESSAGES)
        await console.page.evaluate(KEY, ["keydown", "Space"])
        await console.until("s.driving")
        for _ in range(TRIES):
            sent = await console.page.evaluate(KEY, ["keydown", "KeyW"])
            if any(any(values) for _, values in sent):  # the gate may be shut, or arming's neutral command be due
                break
            await console.page.evaluate(KEY, ["keyup", "KeyW"])
        assert [(kind, values[0] > 0) for kind, values in sent] == [("command", True)]
        released = await console.page.evaluate(KEY, ["keyup", "Space"])
        assert released[0][0] == "rest"
        assert all(not any(values) for _, values in released)
        await console.until("!s.driving && s.at_rest === true")
        await console.page.evaluate(KEY, ["keyup", "KeyW"])


async def test_a_key_that_waited_behind_a_busy_page_drives_nothing_in_its_own_event(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        await console.until("s.seat && s.seat.mine")
        await console.page.keyboard.press("Enter")
        await console.until("s.armed")
        await console.page.evaluate(WATCH_MESSAGES)
        await console.page.evaluate(KEY, ["keydown", "Space"])
        await console.until("s.driving")
        sent = await console.page.evaluate(
            """() => {
              const late = new KeyboardEvent("keydown", { code: "KeyW", bubbles: true, cancelable: true });
              const until = performance.now() + 80;
              while (performance.now() < until);
              return window.sentBy(() => document.body.dispatchEvent(late));
            }"""
        )
        assert sent == []
        await console.page.wait_for_function("window.sentNow.some(({ values }) => values && values[0] > 0)")
        await console.page.evaluate(KEY, ["keyup", "Space"])


async def test_a_finger_drives_and_rests_the_robot_in_its_own_event(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator, pad=False, touch=True) as console:
        await console.until_live()
        await console.until("s.seat && s.seat.mine")
        await console.page.keyboard.press("Enter")
        await console.until("s.armed")
        await console.page.evaluate(WATCH_MESSAGES)
        await console.page.evaluate("() => { Element.prototype.setPointerCapture = () => undefined; }")
        for height in range(TRIES):
            await console.page.evaluate(FINGER, ["pointerdown", 0.5, 0.5])
            sent = await console.page.evaluate(FINGER, ["pointermove", 0.5, 0.3 - height / 1000])
            if any(any(values) for _, values in sent):  # the gate may be shut, or arming's neutral command be due
                break
        assert [(kind, any(values)) for kind, values in sent] == [("command", True)]
        released = await console.page.evaluate(FINGER, ["pointerup", 0.5, 0.5])
        assert released[0][0] == "rest"
        await console.until("!s.driving && s.at_rest === true")
