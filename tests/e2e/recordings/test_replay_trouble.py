"""The player in Chromium when what it plays is damaged, is deleted, or cannot be asked for; VP8 and PCMU."""

import asyncio
import re
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from lockstep.bench.browsers.chromium import open_page
from lockstep.bench.browsers.console_page import ConsolePage
from lockstep.bench.browsers.event_strip import READ_STRIP
from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.server.recording.reading.reader import RecordingReader
from tests.support.stack import Stack
from tests.waiting import PATIENCE

pytestmark = pytest.mark.browser

EVENTS = 100  # to drive for: about five chunks
DRAWN = {"/camera/overview", "/camera/front", "/lockstep/feedback"}  # each in a figure of its own
CAMERAS = ("overview", "front")
PCMU_BYTES = 160  # of 20 ms
HEARD = re.compile(r"packets? · (silent|\S+ dB)")  # it was decoded


def _token(link: str) -> str:
    return link.partition("#token=")[2].partition("&")[0]


async def _ask(stack: Stack, method: str, path: str) -> dict[str, Any]:
    async with httpx.AsyncClient(trust_env=False, timeout=30) as http:
        headers = {"Authorization": f"Bearer {_token(stack.supervisor)}"}
        answer = await http.request(method, f"{stack.console}{path}", headers=headers)
        answer.raise_for_status()
        found: dict[str, Any] = answer.json()
        return found


async def _record_a_drive_in_vp8_and_pcmu(stack: Stack) -> str:
    """Its id. In its second half somebody takes Opus."""
    async with (
        Console(stack.operator, codec="VP8", sound_codec="PCMU", name="Ada", event_rate=25.0) as console,
        AsyncExitStack() as others,
    ):
        await console.take_seat()
        await drive_on(console, [0.3, 0.0, 0.2])
        await _ask(stack, "POST", "/api/recordings")
        for number in range(EVENTS):
            if number == EVENTS // 2:
                await others.enter_async_context(Console(stack.observer, video=False, sound_codec="opus", name="Bo"))
            await drive_on(console, [0.3 if number // 25 % 2 == 0 else -0.3, 0.0, 0.2])
        await _ask(stack, "POST", "/api/recordings/stop")
    (recording,) = (await _ask(stack, "GET", "/api/recordings"))["recordings"]
    found: str = recording["id"]
    return found


def _damage_the_last_chunk(path: Path) -> set[str]:
    """The topics in it: a machine that was busy at the end may have brought no picture of a camera any more."""
    with RecordingReader(path) as reader:
        offset = reader.index.chunks[-1].offset + 500
        records = list(reader.records())
    with path.open("r+b") as file:
        file.seek(offset)
        byte = file.read(1)
        file.seek(offset)
        file.write(bytes([byte[0] ^ 1]))
    return {record.topic for record in records if record.chunk == records[-1].chunk}


async def _seek(page: Page, event: int) -> None:
    await page.evaluate("(event) => { location.hash = location.hash.replace(/event=\\d+/, `event=${event}`); }", event)


async def _strip(page: Page, camera: str) -> dict[str, Any]:
    """As soon as its picture of the event that was looked for is decoded and drawn."""
    async with asyncio.timeout(PATIENCE):
        while (found := await page.evaluate(READ_STRIP, camera)) is None or found["event"] is None:  # noqa: ASYNC110
            await asyncio.sleep(0.02)
    strip: dict[str, Any] = found
    return strip


async def _fits(page: Page) -> None:
    """Nothing is wider than a phone or a laptop, and the alert is in sight."""
    for width, height in ((1280, 800), (390, 844)):
        await page.set_viewport_size({"width": width, "height": height})
        assert await page.evaluate("document.documentElement.scrollWidth") <= width
        await page.set_viewport_size({"width": 1280, "height": 800})


async def test_vp8_and_pcmu_are_played_and_damage_and_deletion_are_said_and_leave_the_rest(
    own_stack: Stack, chromium: Browser, tmp_path: Path
) -> None:
    recording = await _record_a_drive_in_vp8_and_pcmu(own_stack)
    path = tmp_path / "state" / "recordings" / f"{recording}.mcap"
    lost = await asyncio.to_thread(_damage_the_last_chunk, path)
    with RecordingReader(path) as reader:
        chunks = reader.index.chunks
        whole, later, damaged = chunks[0].last_event - 2, chunks[-1].first_event - 1, chunks[-1].last_event
    link = f"{own_stack.console}/recordings#token={_token(own_stack.observer)}&recording={recording}&event={whole}"
    async with open_page(chromium, link) as page:
        replay = ConsolePage(page)
        await replay.until(f"s.ready && s.event === {whole}")
        for camera in CAMERAS:
            strip = await _strip(page, camera)
            assert strip["event"] == strip["stamp"] <= whole
        sound = page.get_by_role("region", name="Sound")
        assert set((await replay.stats())["sounds"]["microphone"]["sizes"]) == {PCMU_BYTES}
        await expect(sound).to_contain_text(HEARD)
        await _seek(page, later)
        await replay.until(f"s.ready && s.event === {later}")
        assert PCMU_BYTES not in (await replay.stats())["sounds"]["microphone"]["sizes"]
        await expect(sound).to_contain_text(HEARD)
        await _seek(page, damaged)
        await replay.until(f"s.ready && s.event === {damaged} && s.unreadable.damaged === 1")
        await expect(page.get_by_text("1 damaged part", exact=True)).to_be_visible()
        say_so = page.locator("figure").get_by_text("This part of the recording is damaged")
        # A camera of which the chunk has no picture may say so too: nobody can read that it has none.
        await expect(say_so.nth(len(lost & DRAWN) - 1)).to_be_visible()
        await _fits(page)
        await _ask(own_stack, "DELETE", f"/api/recordings/{recording}")
        await _seek(page, whole)  # it is loaded
        await replay.until(f"s.ready && s.event === {whole}")
        assert (await _strip(page, "front"))["event"] <= whole


async def test_a_player_of_a_running_recording_outlives_the_loss_of_its_console_and_then_of_its_file(
    own_stack: Stack, chromium: Browser
) -> None:
    await _ask(own_stack, "POST", "/api/recordings")
    async with open_page(chromium, f"{own_stack.console}/recordings#token={_token(own_stack.observer)}") as page:
        replay = ConsolePage(page)
        await page.get_by_role("listitem").get_by_role("button").click()
        await replay.until("s.ready && s.running && s.pictures.front !== undefined")
        alert = page.get_by_role("alert")
        await page.context.set_offline(True)
        await expect(alert).to_contain_text("keeps trying")
        await _fits(page)
        assert (await replay.stats())["pictures"]["front"] is not None
        known = (await replay.stats())["ended"]
        await page.context.set_offline(False)
        await replay.until(f"s.ended > {known} && s.ready")
        await expect(alert).to_be_hidden()
        (recording,) = (await _ask(own_stack, "GET", "/api/recordings"))["recordings"]
        await _ask(own_stack, "POST", "/api/recordings/stop")
        await _ask(own_stack, "DELETE", f"/api/recordings/{recording['id']}")
        await replay.until("s.deleted && !s.running")
        await expect(alert).to_contain_text("This recording was deleted")
        await _fits(page)
