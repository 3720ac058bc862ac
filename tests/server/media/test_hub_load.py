"""The whole media path with real peers on loopback: one encode, keyframes, loss, slow peers, the operator first."""

import asyncio
import threading
from collections.abc import Callable
from contextlib import AsyncExitStack
from typing import Any, cast

import pytest
from aiortc.rtp import RtcpPsfbPacket

from lockstep.protocol.carriers import EVENT_REFERENCE_URI
from lockstep.rtc.rtp.wire.extensions import ABS_SEND_TIME_URI
from tests.server.media.feeding import read_stamp, stream, timestamps, value
from tests.server.media.viewer import (
    TIMEOUT,
    Received,
    Viewer,
    noise,
    picture,
    running_plane,
    sender_of,
    sound,
    viewing,
)


async def test_five_peers_cost_one_encode_per_picture() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        viewers = [await stack.enter_async_context(viewing(hub, ["video"], trailer=i > 2)) for i in range(5)]
        await stream(hub, viewers[0], "video", noise, 6)
        for viewer in viewers:
            await viewer.until(lambda viewer=viewer: timestamps(viewer, "video") == 6)  # type: ignore[misc]
        assert value(hub, "frames_encoded_total", stream="camera0", codec="H264") == 6
        assert value(hub, "encode_seconds_count", stream="camera0", codec="H264") == 6
        assert value(hub, "frames_encoded_total", stream="camera0", codec="VP8") == 0
        assert value(hub, "peers", stream="camera0") == 5


async def test_nothing_is_encoded_while_nobody_watches() -> None:
    async with running_plane() as hub:
        async with viewing(hub, ["video"]) as viewer:
            await stream(hub, viewer, "video", noise, 2)
        hub.feed(noise(3, 1.0), 1.0)
        assert value(hub, "peers", stream="camera0") == 0
        async with viewing(hub, ["video"]) as viewer:
            await stream(hub, viewer, "video", noise, 1, first=60)
            assert value(hub, "frames_encoded_total", stream="camera0", codec="H264") == 3


async def test_a_joining_peer_gets_a_keyframe_with_the_next_picture() -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as first:
        await stream(hub, first, "video", picture, 5)
        assert value(hub, "keyframes_total", stream="camera0", codec="H264") == 1
        async with viewing(hub, ["video"]) as second:
            await stream(hub, second, "video", picture, 1, first=6)
            assert value(hub, "keyframes_total", stream="camera0", codec="H264") == 2
            assert b"\x00\x00\x00\x01\x67" in second.frames("video")[0]  # a sequence parameter set


async def test_a_storm_of_picture_loss_indications_is_merged() -> None:
    async with running_plane(keyframe_spacing_seconds=0.3) as hub, viewing(hub, ["video"]) as viewer:
        await stream(hub, viewer, "video", picture, 2)
        for i in range(3, 33):  # 0.6 s, one request per picture
            viewer.tell(bytes(RtcpPsfbPacket(fmt=1, ssrc=1, media_ssrc=viewer.ssrc)))
            await stream(hub, viewer, "video", picture, 1, first=i)
        assert value(hub, "keyframe_requests_total", stream="camera0", cause="pli") == 30
        assert value(hub, "keyframes_total", stream="camera0", codec="H264") == 2
        assert viewer.stats.keyframe_requests == 30


@pytest.mark.parametrize("codec", ["H264", "VP8"])
async def test_a_lost_packet_is_sent_again_with_its_stamp(codec: str) -> None:
    async with (
        running_plane() as hub,
        viewing(hub, ["video"], codecs=[codec], uris={EVENT_REFERENCE_URI: 9}) as viewer,
    ):
        await stream(hub, viewer, "video", noise, 3)
        lost: list[Received] = []

        def lose_one(received: Received) -> bool:
            if not lost and not received.packet.marker:
                lost.append(received)
                return True
            return False

        viewer.lose = lose_one
        await stream(hub, viewer, "video", noise, 3, first=4)
        main = viewer.of("video")[0].packet.payload_type

        def repaired() -> list[Received]:
            return [r for r in viewer.received if r.packet.payload_type != main]

        await viewer.until(lambda: bool(repaired()))
        again = repaired()[0]
        assert int.from_bytes(again.packet.payload[:2], "big") == lost[0].packet.sequence_number
        assert again.packet.payload[2:] == lost[0].packet.payload
        assert again.extensions.pop(ABS_SEND_TIME_URI) != lost[0].extensions.pop(ABS_SEND_TIME_URI)  # it left later
        assert again.extensions == lost[0].extensions
        assert read_stamp("native", again) == 4
        assert viewer.stats.retransmitted >= 1


async def test_closing_leaves_no_task_and_no_thread() -> None:
    tasks, threads = asyncio.all_tasks(), set(threading.enumerate())
    async with running_plane() as hub, viewing(hub, priority=True) as viewer:
        await stream(hub, viewer, "video", picture, 2)
        await stream(hub, viewer, "audio", sound, 4, first=3)
        await viewer.media.close()
        await viewer.media.close()
    await asyncio.sleep(0)
    assert asyncio.all_tasks() == tasks
    left = {thread for thread in threading.enumerate() if thread.name.startswith("media-")}
    assert left <= threads


async def test_the_newest_picture_wins_and_the_newest_sound_is_kept_while_the_encoder_is_busy() -> None:
    async with running_plane() as hub, viewing(hub) as viewer:
        release = threading.Event()
        seen: dict[str, list[int]] = {"camera0": [], "microphone0": []}
        started = asyncio.Event()
        loop = asyncio.get_running_loop()
        for name, stamps in seen.items():
            encoder = cast(Any, hub)._streams[name].worker.encoder

            def work(job: Any, stamps: list[int] = stamps, original: Any = encoder.encode) -> Any:
                stamps.append(job.media.stamp)
                loop.call_soon_threadsafe(started.set)
                release.wait(TIMEOUT)
                return original(job)

            encoder.encode = work
            started.clear()
            for i in range(1, 17):
                hub.feed(picture(i, i / 50) if name == "camera0" else sound(i, i / 50), i / 50)
                if i == 1:
                    async with asyncio.timeout(TIMEOUT):
                        await started.wait()
        release.set()
        await viewer.until(lambda: timestamps(viewer, "video") == 2 and timestamps(viewer, "audio") >= 9)
        assert seen["camera0"] == [1, 16]
        assert seen["microphone0"] == [1, *range(7, 17)]
        assert value(hub, "frames_dropped_total", stream="camera0", stage="encoder_busy") == 14
        assert value(hub, "frames_dropped_total", stream="microphone0", stage="encoder_busy") == 5


def block(viewer: Viewer) -> Callable[[], None]:
    """Make the server's socket to a viewer look full; returns what makes it look free again."""
    endpoint = cast(Any, viewer.connection)._endpoint  # each viewer of these tests has one of its own
    original = endpoint.is_blocked
    endpoint.is_blocked = lambda path: True

    def free() -> None:
        endpoint.is_blocked = original

    return free


async def test_a_blocked_observer_delays_nobody_and_goes_on_with_a_keyframe() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        operator = await stack.enter_async_context(viewing(hub, ["video"], priority=True))
        observer = await stack.enter_async_context(viewing(hub, ["video"], uris={EVENT_REFERENCE_URI: 9}))
        await stream(hub, operator, "video", picture, 2)
        await observer.until(lambda: timestamps(observer, "video") == 2)
        free = block(observer)
        await stream(hub, operator, "video", picture, 10, first=3)
        assert timestamps(observer, "video") == 2
        assert observer.dropped > 0
        assert operator.dropped == 0
        assert value(hub, "frames_dropped_total", stream="camera0", stage="peer_busy") == observer.dropped
        free()
        await stream(hub, operator, "video", picture, 30, first=13)
        await observer.until(lambda: read_stamp("native", observer.received[-1]) == 42)
        resumed = next(r for r in observer.of("video") if cast(int, read_stamp("native", r)) > 2)
        assert resumed.packet.payload[0] & 0x1F == 24  # parameter sets: a keyframe
        numbers = [received.packet.sequence_number for received in observer.of("video")]
        assert [(n - numbers[0]) % 65536 for n in numbers] == list(range(len(numbers)))


async def test_the_operators_packets_leave_before_feed_of_the_next_picture_and_before_observers() -> None:
    sent: list[str] = []
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        viewers = [await stack.enter_async_context(viewing(hub, ["video"], priority=i == 3)) for i in range(4)]
        for i, viewer in enumerate(viewers):
            sender = cast(Any, sender_of(viewer))

            def spy(frame: Any, i: int = i, transmit: Any = sender.transmit) -> Any:
                sent.append("operator" if i == 3 else "observer")
                return transmit(frame)

            sender.transmit = spy
        for i in range(1, 6):
            await stream(hub, viewers[0], "video", noise, 1, first=i)
            for viewer in viewers:
                await viewer.until(lambda viewer=viewer, i=i: timestamps(viewer, "video") == i)  # type: ignore[misc]
        assert sent == ["operator", "observer", "observer", "observer"] * 5
