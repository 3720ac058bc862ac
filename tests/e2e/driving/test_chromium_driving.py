"""An operator drives the planar robot from real Chromium; the bridge's own log is the truth."""

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.event_strip import drawn_event
from lockstep.bench.browsers.pad import FORWARD, LEFT_Y, RB, START
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

KEY_TRIES = 3  # a busy machine may hold up the robot or the page, which disarms it


async def _driven(console: ConsolePage, events: int) -> None:
    """Arm and drive for that many events."""
    async with console.driving():
        start = (await console.stats())["event"]
        await console.until(f"s.event >= {start + events}", 60)


def _no_violation(statistics: dict[str, object]) -> None:
    streams = statistics["streams"]
    assert isinstance(streams, dict)
    assert streams
    for name, stream in streams.items():
        assert stream["violations"] == 0, name
        tolerance = statistics["tolerance"]
        assert isinstance(tolerance, dict)
        assert stream["max_gap"] <= tolerance[stream["kind"]], name


@pytest.mark.full_rate
async def test_every_stream_arrives_with_the_capture_time_carrier_and_advances(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.until("s.streams.microphone?.received > 0")  # sound comes when its device is open
        streams = (await console.stats())["streams"]
        assert {name: stream["carrier"] for name, stream in streams.items()} == {
            "overview": "capture-time",
            "front": "capture-time",
            "microphone": "capture-time",
        }
        seen = {name: stream["rendered"] for name, stream in streams.items()}
        for name, count in seen.items():
            await console.until(f"s.streams['{name}'].rendered > {count + 10}")


@pytest.mark.full_rate
async def test_driving_moves_the_robot_and_nothing_outside_the_tolerance_is_rendered(
    stack: Stack, loud_chromium: Browser
) -> None:
    async with open_console(loud_chromium, stack.operator) as console:
        await console.until_live()
        await _driven(console, 60)
        # Sound that piled up while the sound device opened must not keep it behind the events for long.
        await console.until("s.streams.microphone.rendered > 60 && s.streams.overview.rendered > 30")
        _no_violation(await console.stats())
        await console.pad.press(RB, False)
        await console.until("!s.driving && s.at_rest === true")
    executed = [record["event"] for record in await stack.events("executed")]
    assert len(executed) >= 60
    assert len(executed) == len(set(executed)), "an event was executed twice"
    assert executed == sorted(executed)


@pytest.mark.full_rate
@pytest.mark.parametrize("carrier", ["capture-time", "trailer"])
async def test_the_event_drawn_into_a_picture_is_the_stamp_it_was_rendered_by(
    stack: Stack, chromium: Browser, carrier: str
) -> None:
    link = stack.operator + ("&stamp=trailer" if carrier == "trailer" else "")
    async with open_console(chromium, link) as console:
        await console.until_live()
        assert (await console.stats())["streams"]["overview"]["carrier"] == carrier
        async with console.driving():
            compared: set[int] = set()
            while len(compared) < 20:
                event = (await console.stats())["event"]
                for stream in ("overview", "front"):
                    read = await drawn_event(console.page, stream)
                    if read is not None and read[1] is not None:
                        assert read[0] == read[1], stream
                        compared.add(read[1])
                await console.until(f"s.event > {event}")
        _no_violation(await console.stats())


@pytest.mark.full_rate
async def test_the_trailer_carries_sound_and_pictures_when_it_is_asked_for(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator + "&stamp=trailer") as console:
        await console.until_live()
        await _driven(console, 40)
        await console.until("s.streams.microphone.rendered > 10")
        statistics = await console.stats()
        assert {stream["carrier"] for stream in statistics["streams"].values()} == {"trailer"}
        _no_violation(statistics)


@pytest.mark.full_rate
async def test_media_pacing_shows_a_picture_for_every_few_events(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.page.get_by_role("button", name="Media", exact=True).click()
        await console.until("s.pacing === 'media'")
        await _driven(console, 40)
        _no_violation(await console.stats())


async def test_blur_disarms_and_the_robot_comes_to_rest(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        await console.page.evaluate("window.dispatchEvent(new Event('blur'))")
        await console.until("!s.armed && s.at_rest === true")
        # The stick is still tilted and the deadman still held: that must not arm it again.
        event = (await console.stats())["event"]
        await console.page.evaluate("window.dispatchEvent(new Event('focus'))")
        await console.pad.press(START)
        await console.until("s.streams.overview.rendered > 0")
        assert not (await console.stats())["armed"]
        assert (await console.stats())["event"] <= event + 1


async def test_an_unplugged_pad_disarms_and_the_robot_comes_to_rest(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator) as console:
        await console.until_live()
        await console.arm()
        await console.drive_forward()
        await console.page.evaluate("window.testPad.unplug()")
        await console.until("!s.armed && s.at_rest === true")


async def test_the_keyboard_drives_while_the_space_bar_is_held(stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, stack.operator, pad=False) as console:
        await console.until_live()
        keyboard = console.page.keyboard
        for _ in range(KEY_TRIES):
            await console.arm_by_key()
            await keyboard.down("KeyW")
            event = (await console.stats())["event"]
            await console.until(f"!s.armed || (s.event > {event} && s.at_rest === true)")
            await keyboard.down("Space")
            await console.until("!s.armed || (s.driving && s.at_rest === false)")
            drives = (await console.stats())["driving"]
            await keyboard.up("Space")
            await console.until("!s.driving && s.at_rest === true")
            await keyboard.up("KeyW")
            if drives:
                return
        raise AssertionError("the keyboard does not drive")


async def test_contact_is_felt_as_rumble(own_stack: Stack, chromium: Browser) -> None:
    async with open_console(chromium, own_stack.operator) as console:
        await console.until_live()
        async with console.driving(FORWARD):
            await console.until("window.testPad.rumbles.length > 0")
        await console.pad.tilt(LEFT_Y, 0)
