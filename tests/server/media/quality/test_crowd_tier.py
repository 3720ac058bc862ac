"""A crowd's pictures and sound, end to end: real peers on loopback. Three observers are a crowd here."""

from contextlib import AbstractAsyncContextManager, AsyncExitStack
from typing import Any, cast

import numpy as np

from lockstep.protocol.carriers import EVENT_REFERENCE_URI
from lockstep.protocol.console import Quality
from lockstep.protocol.messages import Media
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.quality.load_shedding import AFTER
from tests.server.media.camera_h264 import camera_pictures
from tests.server.media.feeding import read_stamp, value
from tests.server.media.pipeline.test_recorded_encoding import Taken
from tests.server.media.viewer import Viewer, description, noise, picture, running_plane, sound, viewing

PICTURES = 12


def controller(hub: MediaHub) -> Any:
    return cast(Any, hub)._quality


def feed(hub: MediaHub, number: int) -> None:
    hub.feed(noise(number, number / 30), number / 30)


async def watching(
    stack: AsyncExitStack,
    hub: MediaHub,
    count: int,
    *,
    priority: bool = False,
    thumbnail: bool = False,
    relays: bool = False,
) -> list[Viewer]:
    def one() -> AbstractAsyncContextManager[Viewer]:
        uris = {EVENT_REFERENCE_URI: 5}
        return viewing(hub, ["video"], uris=uris, priority=priority, thumbnail=thumbnail, relays=relays)

    return [await stack.enter_async_context(one()) for _ in range(count)]


def stamps(viewer: Viewer) -> list[int]:
    """Of the whole pictures that came."""
    found = [read_stamp("native", received) for received in viewer.of("video") if received.packet.marker]
    return [stamp for stamp in found if stamp is not None]


async def came(viewer: Viewer, number: int) -> None:
    await viewer.until(lambda: stamps(viewer)[-1:] == [number])


async def begin(hub: MediaHub, everybody: list[Viewer], second: int) -> None:
    """Feed pictures that come so seldom that a crowd gets them all, until everybody is in its tier."""
    for number in range(30 * second, 30 * second + 90, 30):
        feed(hub, number)
        for viewer in everybody:
            await came(viewer, number)


async def show(hub: MediaHub, whole: list[Viewer], crowd: list[Viewer], second: int) -> None:
    """Feed pictures 30 times a second: `whole` get all of them, and `crowd` the first of every two."""
    for number in range(30 * second, 30 * second + PICTURES):
        feed(hub, number)
        for viewer in whole if number % 2 else [*whole, *crowd]:
            await came(viewer, number)
    for viewer in crowd:
        assert stamps(viewer)[-PICTURES // 2 :] == list(range(30 * second, 30 * second + PICTURES, 2))


def disperse(hub: MediaHub) -> None:
    """Who left has been away for long enough."""
    controller(hub).tick()
    controller(hub)._crowd._fewer_since -= AFTER
    controller(hub).tick()


async def test_a_crowd_gets_every_second_picture_and_the_operator_and_a_relay_all() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(description(microphones=0), crowd_observers=2))
        (operator,) = await watching(stack, hub, 1, priority=True)
        crowd = await watching(stack, hub, 3)
        (relay,) = await watching(stack, hub, 1, relays=True)
        assert [viewer.media.tier for viewer in (operator, *crowd)] == ["operator", "high", "high", "high"]
        await begin(hub, [operator, relay, *crowd], 1)
        before = value(hub, "tier_frames_encoded_total", stream="camera0", tier="crowd")
        await show(hub, [operator, relay], crowd, 10)
        assert value(hub, "tier_frames_encoded_total", stream="camera0", tier="crowd") == before + PICTURES / 2
        controller(hub)._whole_since = float("-inf")  # the operator's serve the high tier
        controller(hub).tick()
        await begin(hub, [operator, relay, *crowd], 20)
        await show(hub, [operator, relay], crowd, 30)
        assert len(cast(Any, hub)._streams["camera0"].worker.encoder._encoders) == 2


async def test_when_a_crowd_has_dispersed_who_stays_gets_everything_and_has_missed_nothing() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        stays, *leave = await watching(stack, hub, 3)
        await begin(hub, [stays, *leave], 1)
        for viewer in leave:
            await viewer.media.close()
        controller(hub).tick()
        await show(hub, [], [stays], 10)
        disperse(hub)
        await begin(hub, [stays], 20)
        await show(hub, [stays], [], 30)
        numbers = [received.packet.sequence_number for received in stays.of("video")]
        assert all((after - before) % 2**16 == 1 for before, after in zip(numbers, numbers[1:], strict=False))


async def test_a_crowd_is_told_what_it_gets_and_why() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        crowd = await watching(stack, hub, 3)
        told: list[Quality] = []
        crowd[0].media.on_quality(told.append)
        for _ in range(10):
            controller(hub).tick()
        for viewer in crowd[1:]:
            await viewer.media.close()
        disperse(hub)
        for _ in range(10):
            controller(hub).tick()
        assert [(each.crowd, each.reason) for each in told] == [(2, ""), (0, "")]
        rates = [(each.streams[0].frames_per_second, each.streams[0].camera_frames_per_second) for each in told]
        assert rates == [(15.0, 30.0), (30.0, 30.0)]
        assert value(hub, "tier_peers", tier="crowd") == 0


async def test_whoever_has_a_narrow_path_gets_no_more_pictures_than_the_crowd() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        (far,) = await watching(stack, hub, 1)
        told: list[Quality] = []
        far.media.on_quality(told.append)
        for others in (0, 3):
            await watching(stack, hub, others)
            far.media.quality.path.rate = 100_000
            for _ in range(20):
                controller(hub).tick()
        among = told[-1].streams[0]
        assert (among.tier, among.frames_per_second, told[-1].crowd) == ("low", 15.0, 2)
        alone = next(each for each in told if each.streams[0].tier == "low")
        assert (alone.streams[0].frames_per_second, alone.crowd) == (30.0, 0)


async def test_an_operator_on_a_narrow_path_beside_a_crowd_gets_all_pictures() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        driver, waits = await watching(stack, hub, 2, priority=True)
        driver.media.drives(True)
        far = (await watching(stack, hub, 4))[0]
        told: dict[Viewer, list[Quality]] = {waits: [], far: []}
        for viewer, said in told.items():
            viewer.media.on_quality(said.append)
            viewer.media.quality.path.rate = 100_000
        for _ in range(20):
            controller(hub).tick()
        assert [viewer.media.tier for viewer in told] == ["low", "low"]
        for said in told.values():
            assert (said[-1].streams[0].frames_per_second, said[-1].crowd) == (30.0, 0)


async def test_operators_thumbnails_and_relays_are_no_crowd() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        first, second = await watching(stack, hub, 2, priority=True)
        others = [second, *await watching(stack, hub, 1, thumbnail=True), *await watching(stack, hub, 2)]
        first.media.drives(True)
        others += await watching(stack, hub, 1, relays=True)
        controller(hub).tick()
        assert controller(hub)._crowd.divisor == 1
        assert [viewer.media.quality.encoded_as for viewer in others] == ["high", "low", "high", "high", "high"]


async def test_one_of_a_crowd_who_takes_control_gets_everything() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        crowd = await watching(stack, hub, 4)
        await begin(hub, crowd, 1)
        await show(hub, [], crowd, 10)
        crowd[0].media.drives(True)
        controller(hub).tick()
        await begin(hub, crowd, 20)
        await show(hub, crowd[:1], crowd[1:], 30)


async def test_what_is_recorded_is_not_thinned() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(description(microphones=0), crowd_observers=2))
        taken = Taken()
        hub.record(taken)
        *crowd, far = await watching(stack, hub, 4)
        far.media.quality.path.rate = 100_000
        for _ in range(10):
            controller(hub).tick()
        assert [viewer.media.quality.encoded_as for viewer in (crowd[0], far)] == ["crowd", "low"]
        assert far.media.quality.hears_as == "crowd"
        await taken.feed(hub, [picture(i, i / 30) for i in range(1, 21)])
        assert taken.stamps == list(range(1, 21))
        assert len(cast(Any, hub)._streams["camera0"].encodings.own.get("H264", "high").targets) == 0
        assert cast(Any, hub)._streams["camera0"].encodings.own.get("H264", "high").recorded


async def test_pictures_that_the_camera_encoded_reach_a_crowd_as_they_come() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        crowd = await watching(stack, hub, 3)
        told: list[Quality] = []
        crowd[0].media.on_quality(told.append)
        for media in camera_pictures(20):
            hub.feed(media, media.time)
            for viewer in crowd:
                await came(viewer, media.stamp)
        for _ in range(10):
            controller(hub).tick()
        assert told[-1].crowd == 0
        assert told[-1].streams[0].frames_per_second > 25


def segment(number: int) -> Media:
    """20 ms that are like no others, in what G.711 can say exactly enough."""
    level = (number * 37 % 200 - 100) * 250
    payload = np.full(160, level, "<i2").tobytes()
    return sound(number, number / 50, rate=8_000, payload=payload)


def heard(viewer: Viewer) -> list[bytes]:
    """The sound that came, 20 ms each."""
    payloads = [bytes(received.packet.payload) for received in viewer.of("audio")]
    return [payload[at : at + 160] for payload in payloads for at in range(0, len(payload), 160)]


async def test_a_crowd_hears_longer_packets_and_who_joins_or_leaves_it_misses_none_and_hears_none_twice() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))

        async def hearing(priority: bool = False) -> Viewer:
            uris = {EVENT_REFERENCE_URI: 5}
            return await stack.enter_async_context(viewing(hub, codecs=["H264", "PCMU"], uris=uris, priority=priority))

        operator, stays = await hearing(priority=True), await hearing()
        number = 0

        async def feed_sound(count: int) -> None:
            nonlocal number
            for _ in range(count):
                number += 1
                hub.feed(segment(number), number / 50)
                await operator.until(lambda count=number: len(heard(operator)) == count)  # type: ignore[misc]

        await feed_sound(4)
        leave = [await hearing(), await hearing()]
        controller(hub).tick()
        assert [viewer.media.quality.hears_as for viewer in (operator, stays, *leave)] == ["operator", *["crowd"] * 3]
        await feed_sound(20)
        before = len(stays.of("audio"))
        await feed_sound(30)
        await stays.until(lambda: len(stays.of("audio")) == before + 10)
        for viewer in leave:
            await viewer.media.close()
        controller(hub).tick()
        disperse(hub)
        await feed_sound(10)
        assert [stays.media.quality.hears_as] == ["operator"]
        await stays.until(lambda: len(heard(stays)) == number)
        assert heard(stays) == heard(operator)
        assert len(set(heard(operator))) > 40
        lengths = [len(received.packet.payload) for received in stays.of("audio")]
        assert lengths[:4] == [160] * 4
        assert lengths[-4:] == [160] * 4
        assert set(lengths) == {160, 480}
        for viewer in (stays, *leave):
            for received in viewer.of("audio"):  # a packet has the event of its oldest sound
                stamp = read_stamp("native", received)
                assert stamp is not None
                assert bytes(received.packet.payload)[:160] == heard(operator)[stamp - 1]
        times = [received.packet.timestamp for received in stays.of("audio")]
        assert all(
            (after - time) % 2**32 == length for time, after, length in zip(times, times[1:], lengths, strict=False)
        )


async def test_what_is_recorded_of_the_sound_is_the_same_with_and_without_a_crowd() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(crowd_observers=2))
        taken = Taken("microphone0")

        def take(stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
            if stream == "microphone0":
                taken(stream, codec, frame, attached=attached)

        hub.record(take)
        crowd = [await stack.enter_async_context(viewing(hub, codecs=["H264", "PCMU"])) for _ in range(2)]
        numbers = iter(range(1, 1000))

        async def record(count: int) -> None:
            await taken.feed(hub, [segment(number) for _, number in zip(range(count), numbers, strict=False)])

        await record(5)
        crowd.append(await stack.enter_async_context(viewing(hub, codecs=["H264", "PCMU"])))
        controller(hub).tick()
        assert crowd[0].media.quality.hears_as == "crowd"
        await record(20)
        for viewer in crowd[1:]:
            await viewer.media.close()
        disperse(hub)
        await record(20)
        assert taken.stamps == list(range(1, 46))
        assert {len(frame.data) for frame in taken.frames} == {160}
