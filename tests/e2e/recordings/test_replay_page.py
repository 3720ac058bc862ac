"""The replay page in real Chromium: what it shows at an event is what the bridge's own log says of it."""

import json
import random
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from lockstep.bench.browsers.chromium import open_page
from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.event_strip import READ_STRIP
from lockstep.emulator import Network
from lockstep.server.recording.reading.reader import Record, RecordingReader
from tests.support.stack import Stack

pytestmark = [pytest.mark.browser, pytest.mark.full_rate]

EVENTS = 40  # to drive for
SEEKS = 10


def _token(link: str) -> str:
    return link.partition("#token=")[2].partition("&")[0]


def _replay_link(stack: Stack, link: str, recording: str, event: int) -> str:
    return f"{stack.console}/recordings#token={_token(link)}&recording={recording}&event={event}"


async def _ask(stack: Stack, method: str, path: str) -> dict[str, Any]:
    async with httpx.AsyncClient(trust_env=False, timeout=30) as http:
        headers = {"Authorization": f"Bearer {_token(stack.operator)}"}
        answer = await http.request(method, f"{stack.console}{path}", headers=headers)
        answer.raise_for_status()
        found: dict[str, Any] = answer.json()
        return found


async def _record_a_drive(stack: Stack, chromium: Browser) -> tuple[str, int, int]:
    """Over the emulated way to Hong Kong. Its id, its first and its last event of driving."""
    async with (
        Network("hong-kong", console_url=stack.console, seed=4) as network,
        open_console(chromium, network.link(stack.operator)) as console,
    ):
        await console.until_live()
        await console.until("s.streams.microphone.rendered > 5", 60)
        await _ask(stack, "POST", "/api/recordings")
        first = (await console.stats())["event"]
        await console.drive_on_until(f"s.event > {first + EVENTS}")
        assert {each["codec"] for each in (await console.stats())["streams"].values()} == {"H264", "opus"}
        last = (await console.stats())["event"]
        await _ask(stack, "POST", "/api/recordings/stop")
    (recording,) = (await _ask(stack, "GET", "/api/recordings"))["recordings"]
    return recording["id"], first + 4, last - 4


async def _seek(page: Page, replay: ConsolePage, event: int) -> dict[str, Any]:
    """As a link to the event that is opened in the same tab."""
    await page.evaluate("(event) => { location.hash = location.hash.replace(/event=\\d+/, `event=${event}`); }", event)
    await replay.until(f"s.ready && s.event === {event}")
    return await replay.stats()


def _newest(records: list[Record], topic: str, event: int) -> list[Record]:
    """Those of the newest stamp that is not newer than `event`, in the order of the file."""
    stamped = [record for record in records if record.topic == topic and record.event <= event]
    return [record for record in stamped if record.event == stamped[-1].event]


async def test_every_event_is_shown_with_exactly_its_pictures_sound_command_and_feedback(
    own_stack: Stack, chromium: Browser, tmp_path: Path
) -> None:
    recording, first, last = await _record_a_drive(own_stack, chromium)
    executed = {each["event"]: each for each in await own_stack.events("executed")}
    measured = {(each["event"], each["issue"]): each for each in await own_stack.events("feedback")}
    captured = {(each["stream"], each["event"]) for each in await own_stack.events("media")}
    with RecordingReader(tmp_path / "state" / "recordings" / f"{recording}.mcap") as reader:
        records = list(reader.records())
    async with open_page(chromium, _replay_link(own_stack, own_stack.observer, recording, first)) as page:
        replay = ConsolePage(page)
        await replay.until("s.ready")
        readable = 0
        for event in random.Random(1).sample(range(first, last), SEEKS):
            shown = await _seek(page, replay, event)
            assert shown["command"]["values"] == executed[event]["values"]
            feedback = shown["feedback"]
            assert feedback["event"] == event
            # The log notes a feedback right after it was measured, all by the bridge's clock.
            noted = measured[event, feedback["issue"]]["time"]
            assert executed[event]["time"] < feedback["time"] <= noted < executed[event + 1]["time"]
            own = [json.loads(each.data) for each in records if each.topic == "/lockstep/feedback"]
            assert feedback["axes"] == [each["axes"] for each in own if each["event"] == event][-1]
            for camera in ("overview", "front"):
                strip = await page.evaluate(READ_STRIP, camera)
                assert strip["stamp"] == _newest(records, f"/camera/{camera}", event)[-1].event
                assert strip["event"] in (strip["stamp"], None)  # unreadable where the path left few bits
                readable += strip["event"] is not None
                assert (camera, strip["stamp"]) in captured
                newest = _newest(records, f"/camera/{camera}", event)[-1]
                assert await page.evaluate("(name) => window.lockstep.picture(name)", camera) == newest.payload.hex()
            packets = _newest(records, "/microphone/microphone", event)
            sound = shown["sounds"]["microphone"]
            assert sound["stamps"] == [each.event for each in packets]
            heard = await page.evaluate("() => window.lockstep.sound('microphone')")
            assert heard == [each.payload.hex() for each in packets]
            assert ("microphone", sound["stamps"][0]) in captured
            await replay.until(f"s.scene.event === {event}")
            x, y, _ = (await replay.stats())["scene"]["bodies"]["base"]
            assert [x, y] == pytest.approx([feedback["joints"][0], feedback["joints"][1]], abs=1e-9)
        assert readable > SEEKS / 2


async def test_a_recording_is_watched_while_it_is_made_then_listed_and_deleted_by_role(
    own_stack: Stack, chromium: Browser
) -> None:
    await _ask(own_stack, "POST", "/api/recordings")
    lists = f"{own_stack.console}/recordings#token="
    async with open_page(chromium, lists + _token(own_stack.observer)) as page:
        row = page.get_by_role("listitem")
        await row.get_by_text("Recording now").wait_for()
        await expect(row.get_by_role("button")).to_have_count(1)  # only to open it
        await row.get_by_role("button").click()
        replay = ConsolePage(page)
        await replay.until("s.ready && s.running && s.pictures.front !== undefined")
        known = (await replay.stats())["ended"]
        await replay.until(f"s.ended > {known} && s.ready")
        await _ask(own_stack, "POST", "/api/recordings/stop")
        await replay.until("!s.running")
    async with open_page(chromium, lists + _token(own_stack.supervisor)) as page:
        async with page.expect_download() as download:
            await page.get_by_role("button", name="Download").click()
        assert (await download.value).suggested_filename.endswith(".mcap")
        await page.get_by_role("button", name="Delete …").click()
        await page.get_by_role("button", name="Delete", exact=True).click()
        await page.get_by_text("Nothing has been recorded yet").wait_for()
