"""The 3D scene in the page: at the event of the picture on screen, veiled when it is not."""

from typing import Any

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.server.scene.page import HOOK
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

# Stands in for viser's client, whose drawing a busy machine is too slow for: a worker that posts batches as viser's
# does, always of the newest feedback, which is ahead of the pictures. The page feeds it that, see FEED.
SCENE = (
    "<!doctype html><html>"
    + HOOK.decode()
    + """<script>
  const echo = "onmessage = ({ data }) => postMessage(data)";
  const worker = new Worker(URL.createObjectURL(new Blob([echo])));
  worker.onmessage = ({ data }) => {
    if (data.type !== "message_batch") return;
    parent.postMessage({ type: "test_delivered", event: Number(data.messages[1].updates.text.slice(2)) }, "*");
  };
  worker.postMessage({ type: "connected" });
  addEventListener("message", ({ data }) => {
    if (data.type !== "test_event") return;
    const label = { type: "SceneNodeUpdateMessage", name: "/robot/base/event", updates: { text: `s ${data.event}` } };
    worker.postMessage({ type: "message_batch", messages: [{ type: "SetPositionMessage" }, label] });
  });
</script></html>"""
)

# The page tells the frame each newest event, and hears what was drawn.
FEED = """() => {
  window.fed = true;
  addEventListener("message", ({ data }) => { if (data.type === "test_delivered") window.delivered = data.event; });
  setInterval(() => {
    const frame = document.querySelector(".scene-frame")?.contentWindow;
    if (window.fed) frame?.postMessage({ type: "test_event", event: lockstep.stats().event }, "*");
  }, 20);
}"""

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
    await console.page.evaluate(FEED)
    await console.open_full_scene()
    await console.until("window.lockstep.scene().state === 'full'", 60)


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
        async with console.driving():
            start = (await console.stats())["event"]
            await console.until(f"s.event > {start + 40} && window.lockstep.scene().event > {start + 30}", 60)
        watched = await _watched(console)
        tolerance = (await console.stats())["tolerance"]["video"]
        assert len({each["event"] for each in watched}) > 10
        for each in watched:
            assert each["event"] <= each["delivered"], "it never claims to draw more than it does"
            assert each["delivered"] <= each["picture"] or abs(each["gap"]) <= tolerance, each
            assert each["forced"] == 0
        # It draws one frame of the page after the picture, which on a busy machine is the next event.
        assert any(each["event"] == each["picture"] for each in watched)
        assert sum(abs(each["event"] - each["picture"]) <= 1 for each in watched) > len(watched) / 2
        assert any(f"s {each['event']} · gap" in each["caption"] for each in watched)


async def test_a_scene_that_stands_still_is_veiled_while_the_robot_goes_on(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await _open_scene(console)
        veil = console.page.locator('[data-view="3D scene"] .veil-words')
        await veil.wait_for(state="hidden")
        await console.page.evaluate("window.fed = false")
        async with console.driving():
            await veil.get_by_text("events behind").wait_for()


# What somebody's script would try in the frame: the page around it, what the browser keeps, the console's interface.
TRY = """async () => {
  const tried = async (attempt) => { try { return String(await attempt()); } catch (error) { return error.name; } };
  return {
    origin: self.origin,
    page: await tried(() => parent.document.title),
    token: await tried(() => parent.location.hash),
    storage: await tried(() => { localStorage.setItem("lockstep.pads", "[]"); return "stored"; }),
    cookie: await tried(() => { document.cookie = "a=b"; return "set"; }),
    api: await tried(async () => (await fetch("/api/session")).status),
    stranger: await tried(async () => (await fetch("data:application/octet-stream;base64,AAAA")).status),
    navigation: await tried(() => { top.location = "/"; return "went"; }),
  };
}"""


async def test_whatever_runs_in_the_3d_scene_reaches_neither_the_page_nor_the_token_nor_what_the_browser_keeps(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        await console.open_full_scene()
        canvas = console.page.frame_locator("iframe").locator("canvas").first
        await canvas.wait_for(state="attached", timeout=60_000)
        found = await canvas.evaluate(TRY, timeout=60_000)  # in the frame that is there by then
        assert found["origin"] == "null"
        assert found["api"] == "TypeError", "its policy lets it speak with its stream alone"
        assert found["stranger"] == "TypeError"
        for what in ("page", "token", "storage", "cookie", "navigation"):
            assert found[what] == "SecurityError", what
        assert await console.page.evaluate("localStorage.getItem('lockstep.pads')") is None


# A recording of viser's that runs a script: what a link would bring.
PLAYBACK = "playbackPath=data:application/octet-stream;base64,gqhkdXJhdGlvblNlY29uZHMBqG1lc3NhZ2VzkA=="


async def test_a_link_that_brings_a_recording_of_its_own_opens_nothing_with_or_without_a_ticket(
    stack: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, stack.observer, pad=False) as console:
        await console.until_live()
        token = stack.observer.partition("#token=")[2]
        path = await console.page.evaluate(
            "async (token) => (await (await fetch('/api/scene', {method: 'POST',"
            " headers: {Authorization: `Bearer ${token}`}})).json()).path",
            token,
        )
        asked = console.page.evaluate
        assert await asked("async (path) => (await fetch(path)).status", f"/scene/?{PLAYBACK}") == 404
        assert await asked("async (path) => (await fetch(path)).status", f"{path}&{PLAYBACK}") == 422
        # By itself in a tab it is as far from the console.
        tab = await console.page.context.new_page()
        await tab.goto(f"{stack.console}{path}", wait_until="commit")
        assert await tab.evaluate("self.origin") == "null"
        assert (await tab.evaluate(TRY))["storage"] == "SecurityError"
