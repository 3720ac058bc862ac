"""Real Firefox: it refuses abs-capture-time, so the trailer carries the event reference."""

import json
from collections.abc import AsyncIterator

import pytest

from tests.support.firefox import Firefox, running_firefox
from tests.support.stack import Stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]

STATS = "window.lockstep.stats()"


@pytest.fixture
async def firefox() -> AsyncIterator[Firefox]:
    async with running_firefox() as browser:
        yield browser


async def _until(firefox: Firefox, condition: str, seconds: float = 30.0) -> None:
    await firefox.wait(
        f"(() => {{ const s = window.lockstep?.stats(); return Boolean(s && ({condition})); }})()", seconds
    )


async def test_the_trailer_carries_pictures_and_sound_and_nothing_outside_the_tolerance_is_rendered(
    stack: Stack, firefox: Firefox
) -> None:
    await firefox.open(stack.operator)
    await _until(firefox, "s.connected && s.streams.overview?.rendered > 5 && s.streams.front?.rendered > 5", 60)
    streams = (await firefox.evaluate(STATS))["streams"]
    assert {stream["carrier"] for stream in streams.values()} == {"trailer"}
    await firefox.evaluate("document.querySelector('button.sound, [aria-label=\"Turn on sound\"]')?.click()")
    await _until(firefox, "s.streams.microphone.rendered > 10")
    await _until(firefox, "s.seat && s.seat.mine")
    await firefox.key("Enter", down=True)
    await firefox.key("Enter", down=False)
    await _until(firefox, "s.armed")
    await firefox.key("Space", down=True)
    await firefox.key("KeyW", down=True)
    event = (await firefox.evaluate(STATS))["event"]
    await _until(firefox, f"s.event > {event + 40}", 60)
    statistics = await firefox.evaluate(STATS)
    await firefox.key("Space", down=False)
    await _until(firefox, "s.at_rest === true")
    assert {name: stream["violations"] for name, stream in statistics["streams"].items()} == dict.fromkeys(streams, 0)
    assert statistics["streams"]["overview"]["rendered"] > 20, json.dumps(statistics)
    assert await firefox.errors() == []
