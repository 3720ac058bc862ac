"""A real Chromium behind a LiveKit. Both clients are LiveKit's own; only the server between them is a stand-in."""

from pathlib import Path

import pytest
from playwright.async_api import Browser

from bench.browsers.console_page import ConsolePage, open_console
from bench.browsers.sound_card import SoundCard
from tests.support.livekit_stand_in import KEY, SECRET, LiveKitStandIn, livekit_stand_in
from tests.support.stack import running_stack

pytestmark = [pytest.mark.browser, pytest.mark.full_rate, pytest.mark.timeout(240)]

TONE = 440.0  # Hz, what the planar robot plays
SECRETS = {"LOCKSTEP_RELAY_KEY": KEY, "LOCKSTEP_RELAY_SECRET": SECRET}


async def test_pictures_and_sound_pass_the_gate_and_when_the_relay_dies_the_console_serves_the_page_itself(
    tmp_path: Path, loud_chromium: Browser, sound_card: SoundCard
) -> None:
    async with livekit_stand_in() as server:
        extra = ("--relay", f"livekit:{server.url}?room=demo", "--observers-direct", "0")
        async with (
            running_stack(tmp_path, extra=extra, settings=SECRETS) as stack,
            open_console(loud_chromium, stack.observer, pad=False) as page,
        ):
            await _through_the_relay(page, server)
            await page.until("s.streams.overview?.rendered > 10", 60)
            shown = await page.strip("overview")  # noqa: B005  # not of a string
            await page.until("s.streams.microphone?.rendered > 20", 60)
            heard = await sound_card.hears(TONE, 0.02)
            statistics = await page.stats()
            server.accepts = False
            for member in list(server.members):
                await member.socket.close()
            await page.until("s.relay === null && s.streams.overview?.rendered > 3", 40)
            after = await page.stats()
    assert shown is not None
    assert shown[0] == shown[1]
    assert heard
    for each in (statistics, after):
        assert [name for name, stream in each["streams"].items() if stream["violations"]] == []
        assert each["bad_messages"] == 0
    assert {stream["carrier"] for stream in statistics["streams"].values()} == {"trailer"}


async def _through_the_relay(page: ConsolePage, server: LiveKitStandIn) -> None:
    """The first who ask may be served directly; a page that is loaded again asks again."""
    await server.until(lambda: any(len(each.tracks) == 2 for each in server.members), 60)
    for _ in range(4):
        await page.page.reload()
        try:
            await page.until("s.relay === '0'", 20)
            return
        except AssertionError:
            continue
    raise AssertionError("never sent to the relay")
