"""Real Firefox: it refuses abs-capture-time, so the trailer carries the event reference."""

import pytest

from lockstep.bench.browsers.firefox import Firefox
from lockstep.bench.browsers.sound_card import SoundCard
from lockstep.emulator import Network
from tests.support.stack import Stack

pytestmark = [pytest.mark.browser, pytest.mark.full_rate, pytest.mark.timeout(300)]

TONE = 440.0  # Hz, what the planar robot plays
STATS = "window.lockstep.stats()"


async def _until(firefox: Firefox, condition: str, seconds: float = 30.0) -> None:
    await firefox.wait(
        f"(() => {{ const s = window.lockstep?.stats(); return Boolean(s && ({condition})); }})()", seconds
    )


async def _connected(firefox: Firefox, link: str) -> None:
    await firefox.open(link)
    await _until(firefox, "s.connected && s.streams.overview?.rendered > 5 && s.streams.front?.rendered > 5", 60)
    if (await firefox.evaluate(STATS))["sound"] == "off":
        await firefox.click("button.sound")
    await _until(firefox, "s.streams.microphone.rendered > 10")


async def test_the_robots_tone_comes_out_of_the_loudspeaker(
    stack: Stack, firefox: Firefox, sound_card: SoundCard
) -> None:
    await _connected(firefox, stack.operator)
    assert await sound_card.hears(TONE, 0.04)


async def test_the_trailer_carries_pictures_and_sound_and_nothing_outside_the_tolerance_is_rendered(
    stack: Stack, firefox: Firefox
) -> None:
    await _connected(firefox, stack.operator)
    streams = (await firefox.evaluate(STATS))["streams"]
    assert {stream["carrier"] for stream in streams.values()} == {"trailer"}
    await _until(firefox, "s.seat && s.seat.mine")
    await firefox.key("Enter", down=True)
    await firefox.key("Enter", down=False)
    await _until(firefox, "s.armed")
    await firefox.key(" ", down=True)
    await firefox.key("w", down=True)
    event = (await firefox.evaluate(STATS))["event"]
    await _until(firefox, f"s.event > {event + 40} && s.streams.overview.rendered > 20", 60)
    statistics = await firefox.evaluate(STATS)
    await firefox.key(" ", down=False)
    await _until(firefox, "s.at_rest === true")
    assert {name: stream["violations"] for name, stream in statistics["streams"].items()} == dict.fromkeys(streams, 0)
    assert await firefox.errors() == []


async def test_after_an_outage_the_same_page_goes_on_at_the_present_event(stack: Stack, firefox: Firefox) -> None:
    async with Network("micro-lan", console_url=stack.console) as network:
        await _connected(firefox, network.link(stack.operator))
        await firefox.evaluate("window.notReloaded = true")
        before = await firefox.evaluate(STATS)
        network.outage(4.0)
        stale = "document.querySelector('.console').dataset.stale === '{}'"
        await _until(firefox, stale.format("true"))
        shown = before["streams"]["overview"]["rendered"]
        await _until(firefox, f"{stale.format('false')} && s.streams.overview.rendered > {shown} + 30", 60)
        after = await firefox.evaluate(STATS)
        assert (after["epoch"], await firefox.evaluate("window.notReloaded")) == (before["epoch"], True)
        assert after["event"] >= before["event"]
        assert all(stream["violations"] == 0 for stream in after["streams"].values())
        assert network.statistics().paths["media"]["to_operator"].passed > 20, "its pictures came through the network"
    assert await firefox.errors() == []
