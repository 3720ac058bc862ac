"""Unmodified Chromium behind an emulated network; Firefox in test_firefox.py."""

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import open_console
from lockstep.emulator import Network
from tests.support.stack import Stack

TRIES = 5

pytestmark = [pytest.mark.browser, pytest.mark.full_rate]


async def test_with_bursts_of_loss_the_page_drives_and_shows_nothing_outside_the_tolerance(
    stack: Stack, chromium: Browser
) -> None:
    async with (
        Network("bursty-loss", console_url=stack.console) as network,
        open_console(chromium, network.link(stack.operator)) as console,
    ):
        await console.until_live()
        for _ in range(TRIES):
            event = (await console.stats())["event"]
            await console.drive_on_until(f"s.event > {event + 30}")
            statistics = await console.stats()
            counts = network.statistics().paths
            if counts["media"]["to_operator"].lost > 10 and counts["control"]["to_robot"].lost > 0:
                break  # else none of the bursts was long enough
            await console.pad.let_go()
            await console.until("s.at_rest === true")
            await console.page.evaluate("window.dispatchEvent(new Event('blur'))")
            await console.until("!s.armed")
    streams = statistics["streams"]
    assert {name: stream["violations"] for name, stream in streams.items()} == dict.fromkeys(streams, 0)
    assert statistics["round_trip_ms"] >= 100
    assert counts["media"]["to_operator"].lost > 10
    assert counts["control"]["to_robot"].lost > 0
