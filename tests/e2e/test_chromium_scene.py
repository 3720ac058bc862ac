"""The 3D scene in the page: at the event of the picture on screen, veiled when it is not."""

from typing import Any

import pytest
from playwright.async_api import Browser

from bench.browsers.console_page import ConsolePage, open_console
from server.scene_proxy import HOOK
from tests.support.stack import Stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

# Stands in for viser's client, whose drawing a busy machine is too slow for: a worker that posts batches as viser's
# does, always of the newest feedback, which is ahead of the pictures.
SCENE = (
    "<!doctype html><html>"
    + HOOK.decode()
    + """<script>
  const echo = "onmessage = ({ data }) => postMessage(data)";
  const worker = new Worker(URL.createObjectURL(new Blob([echo])));
  worker.onmessage = ({ data }) => {
    if (data.type === "message_batch") parent.delivered = Number(data.messages[1].updates.text.slice(2));
  };
  worker.postMessage({ type: "connected" });
  setInterval(() => {
    const text = `s ${parent.lockstep.stats().event}`;
    const label = { type: "SceneNodeUpdateMessage", name: "/robot/base/event", updates: { text } };
    worker.postMessage({ type: "message_batch", messages: [{ type: "SetPositionMessage" }, label] });
  }, 20);
</script></html>"""
)

# At every frame: what the scene and the picture show, and whether the scene may be seen.
WATCH = """() => {
  window.watched = [];
  const look = () => {
    const { event, gap, forced } = lockstep.scene();
    const picture = lockstep.rendered("overview").at(-1).stamp;
    const figure = document.querySelector('[data-view="3D scene"]');
    const veiled = !figure.querySelector(".veil").hidden;
    const caption = figure.querySelector(".view-detail").textContent;
    watched.push({ event, gap, forced, veiled, caption, picture, delivered: window.delivered });
    requestAnimationFrame(look);
  };
  look();
}"""


async def _open_scene(console: ConsolePage) -> None:
    await console.page.route("**/scene/**", lambda route: route.fulfill(body=SCENE, content_type="text/html"))
    await console.page.get_by_role("button", name="Show 3D scene large").click()
    await console.until("window.lockstep.scene().event !== null", 60)


async def _watched(console: ConsolePage) -> list[dict[str, Any]]:
    watched: list[dict[str, Any]] = await console.page.evaluate("watched")
    return watched


async def test_the_scene_shows_no_newer_event_than_the_picture_and_is_veiled_out_of_tolerance(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await _open_scene(console)
        await console.page.evaluate(WATCH)
        await console.arm()
        await console.drive_forward()
        start = (await console.stats())["event"]
        await console.until(f"s.event > {start + 40} && window.lockstep.scene().event > {start + 30}", 60)
        watched = await _watched(console)
        tolerance = (await console.stats())["tolerance"]["video"]
        assert len({each["event"] for each in watched}) > 10
        for each in watched:
            assert each["event"] == each["delivered"]
            assert each["event"] <= each["picture"] or abs(each["gap"]) <= tolerance, each
            assert each["forced"] == 0
        # As a rule it is the picture's very event.
        assert sum(each["event"] == each["picture"] for each in watched) > len(watched) / 2
        assert any(f"s {each['event']} · gap" in each["caption"] for each in watched)


async def test_a_scene_that_stands_still_is_veiled_while_the_robot_goes_on(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await _open_scene(console)
        veil = console.page.locator('[data-view="3D scene"] .veil-words')
        await veil.wait_for(state="hidden")
        await console.page.evaluate("document.querySelector('.scene-frame').contentWindow.clearInterval(1)")
        await console.arm()
        await console.drive_forward()
        await veil.get_by_text("events behind").wait_for()
