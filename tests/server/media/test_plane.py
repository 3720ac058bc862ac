"""The whole media path: a plane that is fed, real peers on loopback."""

import asyncio
import threading
from collections.abc import Callable
from contextlib import AsyncExitStack
from typing import Any, cast

import pytest
from aiortc.rtp import RtcpPsfbPacket, RtcpRtpfbPacket
from prometheus_client import CollectorRegistry

from robot_bridge.protocol.carriers import (
    CAPTURE_TIME_URI,
    EVENT_REFERENCE_URI,
    PLAYOUT_DELAY_URI,
    Carrier,
    split_trailer,
    unpack_capture_time,
    unpack_event_reference,
)
from robot_bridge.protocol.messages import Media
from server.media.plane import MediaPlane, MediaSettings
from tests.server.media.viewer import (
    TIMEOUT,
    Received,
    Viewer,
    description,
    noise,
    picture,
    running_plane,
    sound,
    viewing,
)

Make = Callable[[int, float], Media]


async def stream(plane: MediaPlane, viewer: Viewer, kind: str, make: Make, count: int, first: int = 1) -> None:
    """Feed media one by one, each when the one before was received; event i is captured at i / 50 s."""
    for i in range(first, first + count):
        before = timestamps(viewer, kind)
        plane.feed(make(i, i / 50), i / 50)
        if kind == "video" or i > first + 1:  # a resampler keeps some of the first sound back
            await viewer.until(lambda before=before: timestamps(viewer, kind) > before)  # type: ignore[misc]


def timestamps(viewer: Viewer, kind: str) -> int:
    return len({received.packet.timestamp for received in viewer.of(kind) if received.packet.marker or kind == "audio"})


def value(plane: MediaPlane, name: str, **labels: str) -> float:
    """A metric of the plane; 0 before it first counted."""
    registry = cast(Any, plane).registry
    return registry.get_sample_value(f"lockstep_media_{name}", labels) or 0.0


async def refused(plane: MediaPlane, media: Media) -> None:
    """Feed a medium and wait until the stream's worker is through with it."""
    stream = cast(Any, plane)._streams[media.stream]
    finish, finished = stream._finish, asyncio.Event()

    def spy(encoded: Any) -> None:
        finish(encoded)
        finished.set()

    stream._finish = spy
    plane.feed(media, media.time)
    async with asyncio.timeout(TIMEOUT):
        await finished.wait()
    stream._finish = finish


def read_stamp(carrier: Carrier, received: Received) -> int | None:
    if carrier == "native":
        return unpack_event_reference(received.extensions[EVENT_REFERENCE_URI])
    return unpack_capture_time(received.extensions[CAPTURE_TIME_URI])


@pytest.mark.parametrize("codec", ["H264", "VP8"])
@pytest.mark.parametrize(("carrier", "uri"), [("native", EVENT_REFERENCE_URI), ("capture-time", CAPTURE_TIME_URI)])
async def test_every_video_packet_carries_the_stamp_of_its_picture(codec: str, carrier: Carrier, uri: str) -> None:
    async with running_plane() as plane, viewing(plane, ["video"], codecs=[codec], uris={uri: 9}) as viewer:
        assert [(s.codec, s.carrier) for s in viewer.media.streams] == [(codec, carrier)]
        await stream(plane, viewer, "video", noise, 8)
        received = viewer.of("video")
        by_picture: dict[int, set[int | None]] = {}
        for item in received:
            by_picture.setdefault(item.packet.timestamp, set()).add(read_stamp(carrier, item))
        assert list(by_picture.values()) == [{i} for i in range(1, 9)]
        assert len(received) > 8
        assert all(len(item.packet.payload) <= 1200 for item in received)


@pytest.mark.parametrize("codec", ["opus", "PCMU"])
@pytest.mark.parametrize(("carrier", "uri"), [("native", EVENT_REFERENCE_URI), ("capture-time", CAPTURE_TIME_URI)])
async def test_sound_packets_are_stamped_and_never_newer_than_their_sound(
    codec: str, carrier: Carrier, uri: str
) -> None:
    async with running_plane() as plane, viewing(plane, ["audio"], codecs=[codec], uris={uri: 9}) as viewer:
        assert [(s.codec, s.carrier) for s in viewer.media.streams] == [(codec, carrier)]
        await stream(plane, viewer, "audio", sound, 12)
        received = viewer.of("audio")
        stamps = [read_stamp(carrier, item) for item in received]
        assert None not in stamps
        for i, stamp in enumerate(stamps):
            assert i <= cast(int, stamp) <= i + 1
        step = 960 if codec == "opus" else 160
        first = received[0].packet.timestamp
        assert [(item.packet.timestamp - first) % 2**32 for item in received] == [
            i * step for i in range(len(received))
        ]


@pytest.mark.parametrize(("kind", "codec"), [("video", "H264"), ("video", "VP8"), ("audio", "opus"), ("audio", "PCMU")])
async def test_every_frame_ends_with_the_trailer_when_it_is_asked_for(kind: str, codec: str) -> None:
    make = noise if kind == "video" else sound
    async with running_plane() as plane, viewing(plane, [kind], codecs=[codec], trailer=True) as viewer:
        assert [s.carrier for s in viewer.media.streams] == ["trailer"]
        await stream(plane, viewer, kind, make, 8)
        for i, frame in enumerate(viewer.frames(kind)):
            rest, trailer = split_trailer(frame)
            assert trailer is not None
            assert trailer.event in (i, i + 1)
            assert rest


async def test_a_peer_gets_only_what_its_offer_asked_for() -> None:
    everything = {EVENT_REFERENCE_URI: 9, CAPTURE_TIME_URI: 10, PLAYOUT_DELAY_URI: 11}
    async with AsyncExitStack() as stack:
        plane = await stack.enter_async_context(running_plane())
        plain = await stack.enter_async_context(viewing(plane, ["video"]))
        native = await stack.enter_async_context(viewing(plane, ["video"], uris=everything))
        trailer = await stack.enter_async_context(viewing(plane, ["video"], uris=everything, trailer=True))
        assert [v.media.streams[0].carrier for v in (plain, native, trailer)] == ["none", "native", "trailer"]
        await stream(plane, plain, "video", noise, 3)
        for viewer in (native, trailer):
            await viewer.until(lambda viewer=viewer: timestamps(viewer, "video") == 3)  # type: ignore[misc]
        special = set(everything)
        assert all(not special & set(r.extensions) for r in plain.of("video"))
        assert all(special & set(r.extensions) == {EVENT_REFERENCE_URI, PLAYOUT_DELAY_URI} for r in native.of("video"))
        assert all(special & set(r.extensions) == {PLAYOUT_DELAY_URI} for r in trailer.of("video"))
        assert CAPTURE_TIME_URI not in native.answer
        assert EVENT_REFERENCE_URI not in trailer.answer
        assert split_trailer(plain.frames("video")[-1])[1] is None
        assert split_trailer(native.frames("video")[-1])[1] is None


async def test_playout_delay_is_never_sent_for_sound() -> None:
    async with running_plane() as plane, viewing(plane, ["audio"], uris={PLAYOUT_DELAY_URI: 9}) as viewer:
        await stream(plane, viewer, "audio", sound, 4)
        assert all(PLAYOUT_DELAY_URI not in received.extensions for received in viewer.of("audio"))


async def test_five_peers_cost_one_encode_per_picture() -> None:
    async with AsyncExitStack() as stack:
        plane = await stack.enter_async_context(running_plane())
        viewers = [await stack.enter_async_context(viewing(plane, ["video"], trailer=i > 2)) for i in range(5)]
        await stream(plane, viewers[0], "video", noise, 6)
        for viewer in viewers:
            await viewer.until(lambda viewer=viewer: timestamps(viewer, "video") == 6)  # type: ignore[misc]
        assert value(plane, "frames_encoded_total", stream="camera0", codec="H264") == 6
        assert value(plane, "encode_seconds_count", stream="camera0", codec="H264") == 6
        assert value(plane, "frames_encoded_total", stream="camera0", codec="VP8") == 0
        assert value(plane, "peers", stream="camera0") == 5


async def test_nothing_is_encoded_while_nobody_watches() -> None:
    async with running_plane() as plane:
        async with viewing(plane, ["video"]) as viewer:
            await stream(plane, viewer, "video", noise, 2)
        plane.feed(noise(3, 1.0), 1.0)
        assert value(plane, "peers", stream="camera0") == 0
        async with viewing(plane, ["video"]) as viewer:
            await stream(plane, viewer, "video", noise, 1, first=60)
            assert value(plane, "frames_encoded_total", stream="camera0", codec="H264") == 3


async def test_a_joining_peer_gets_a_keyframe_with_the_next_picture() -> None:
    async with running_plane() as plane, viewing(plane, ["video"]) as first:
        await stream(plane, first, "video", picture, 5)
        assert value(plane, "keyframes_total", stream="camera0", codec="H264") == 1
        async with viewing(plane, ["video"]) as second:
            await stream(plane, second, "video", picture, 1, first=6)
            assert value(plane, "keyframes_total", stream="camera0", codec="H264") == 2
            assert b"\x00\x00\x00\x01\x67" in second.frames("video")[0]  # a sequence parameter set


async def test_a_storm_of_picture_loss_indications_is_merged() -> None:
    async with running_plane(keyframe_spacing_seconds=0.3) as plane, viewing(plane, ["video"]) as viewer:
        await stream(plane, viewer, "video", picture, 2)
        sender = viewer.media._deliveries[0].sender
        for i in range(3, 33):  # 0.6 s, one request per picture
            await sender._handle_rtcp_packet(RtcpPsfbPacket(fmt=1, ssrc=1, media_ssrc=sender._ssrc))
            await stream(plane, viewer, "video", picture, 1, first=i)
        assert value(plane, "keyframe_requests_total", stream="camera0", cause="pli") == 30
        assert value(plane, "keyframes_total", stream="camera0", codec="H264") == 3
        assert viewer.media.stats[viewer.media.streams[0].mid].keyframe_requests == 30


@pytest.mark.parametrize("codec", ["H264", "VP8"])
async def test_a_lost_packet_is_sent_again_with_its_stamp(codec: str) -> None:
    async with (
        running_plane() as plane,
        viewing(plane, ["video"], codecs=[codec], uris={EVENT_REFERENCE_URI: 9}) as viewer,
    ):
        await stream(plane, viewer, "video", noise, 3)
        lost: list[Received] = []

        def lose_one(received: Received) -> bool:
            if not lost and not received.packet.marker:
                lost.append(received)
                return True
            return False

        viewer.lose = lose_one
        await stream(plane, viewer, "video", noise, 3, first=4)
        main = viewer.of("video")[0].packet.payload_type

        def repaired() -> list[Received]:
            return [r for r in viewer.received if r.packet.payload_type != main]

        await viewer.until(lambda: bool(repaired()))
        again = repaired()[0]
        assert int.from_bytes(again.packet.payload[:2], "big") == lost[0].packet.sequence_number
        assert again.packet.payload[2:] == lost[0].packet.payload
        assert again.extensions == lost[0].extensions
        assert read_stamp("native", again) == 4
        assert viewer.media.stats[viewer.media.streams[0].mid].retransmitted >= 1


async def test_surplus_sections_are_inactive_and_names_travel_in_the_answer() -> None:
    kinds = ["video", "audio", "video", "video", "audio"]
    async with running_plane(description(cameras=2)) as plane, viewing(plane, kinds) as viewer:
        assert [(s.stream, s.kind) for s in viewer.media.streams] == [
            ("camera0", "video"),
            ("microphone0", "audio"),
            ("camera1", "video"),
        ]
        directions = [t.currentDirection for t in viewer.pc.getTransceivers()]
        assert directions == ["recvonly", "recvonly", "recvonly", "inactive", "inactive"]
        for name in ("camera0", "microphone0", "camera1"):
            assert f"a=msid:{name} " in viewer.answer
        mids = [t.mid for t in viewer.pc.getTransceivers()]
        assert [s.mid for s in viewer.media.streams] == mids[:3]
        plane.feed(picture(1, 1.0, "camera1"), 1.0)
        await viewer.until(lambda: bool(viewer.received))


@pytest.mark.parametrize("order", [["H264", "VP8"], ["VP8", "H264"]])
async def test_the_offers_order_decides_the_codec(order: list[str]) -> None:
    async with running_plane() as plane, viewing(plane, ["video"], codecs=order) as viewer:
        assert viewer.media.streams[0].codec == order[0]


async def test_a_section_without_a_codec_in_common_is_inactive() -> None:
    async with running_plane() as plane, viewing(plane, ["video", "audio"], codecs=["H264", "PCMA"]) as viewer:
        assert [s.stream for s in viewer.media.streams] == ["camera0"]


@pytest.mark.parametrize("codec", ["H264", "VP8"])
async def test_pictures_are_decoded_by_the_peer(codec: str) -> None:
    async with running_plane() as plane, viewing(plane, ["video"], codecs=[codec]) as viewer:
        track = viewer.pc.getTransceivers()[0].receiver.track
        await stream(plane, viewer, "video", picture, 5)
        async with asyncio.timeout(TIMEOUT):
            frame = await track.recv()
        assert abs(int(cast(Any, frame).to_ndarray()[60, 80]) - 21) < 4


async def test_a_medium_older_than_the_one_before_is_dropped_and_counted() -> None:
    async with running_plane() as plane, viewing(plane, ["video"]) as viewer:
        await stream(plane, viewer, "video", picture, 2, first=5)
        plane.feed(picture(4, 1.0), 1.0)
        assert value(plane, "frames_dropped_total", stream="camera0", stage="stale_stamp") == 1


@pytest.mark.parametrize(
    ("changes", "stage"),
    [
        ({"payload": b"short"}, "bad_payload"),
        ({"width": 0}, "bad_payload"),
        ({"codec": "mjpeg", "payload": b"\xff\xd8 no picture"}, "bad_payload"),
        ({"codec": "pcm_s16le"}, "unsupported_codec"),
    ],
)
async def test_bad_pictures_are_counted_and_the_next_good_one_passes(changes: dict[str, Any], stage: str) -> None:
    async with running_plane() as plane, viewing(plane, ["video"]) as viewer:
        await refused(plane, picture(1, 0.0, **changes))
        await stream(plane, viewer, "video", picture, 1, first=2)
        assert value(plane, "frames_dropped_total", stream="camera0", stage=stage) == 1


@pytest.mark.parametrize(
    ("changes", "stage"),
    [
        ({"payload": b"odd"}, "bad_payload"),
        ({"channels": 3}, "bad_payload"),
        ({"sample_rate": 10}, "bad_payload"),
        ({"codec": "mjpeg"}, "unsupported_codec"),
    ],
)
async def test_bad_sound_is_counted_and_the_next_good_one_passes(changes: dict[str, Any], stage: str) -> None:
    async with running_plane() as plane, viewing(plane, ["audio"]) as viewer:
        await refused(plane, sound(1, 0.0, **changes))
        await stream(plane, viewer, "audio", sound, 4, first=2)
        assert value(plane, "frames_dropped_total", stream="microphone0", stage=stage) == 1


async def test_an_unknown_stream_is_counted() -> None:
    async with running_plane() as plane:
        plane.feed(picture(1, 0.0, "no such camera"), 0.0)
        assert value(plane, "frames_dropped_total", stream="", stage="unknown_stream") == 1


async def test_pictures_encoded_at_the_robot_reach_h264_peers_and_are_refused_for_vp8() -> None:
    async with AsyncExitStack() as stack:
        plane = await stack.enter_async_context(running_plane())
        viewer = await stack.enter_async_context(viewing(plane, ["video"], uris={EVENT_REFERENCE_URI: 9}))
        await stack.enter_async_context(viewing(plane, ["video"], codecs=["VP8"]))
        delta = picture(1, 0.0, codec="h264", payload=b"\x00\x00\x00\x01\x61delta", keyframe=False)
        key = picture(2, 0.1, codec="h264", payload=b"\x00\x00\x00\x01\x65key", keyframe=True)
        for medium in (delta, key):
            plane.feed(medium, medium.time)
        await viewer.until(lambda: bool(viewer.of("video")))
        assert [(r.packet.payload, read_stamp("native", r)) for r in viewer.of("video")] == [(b"\x65key", 2)]
        assert value(plane, "frames_dropped_total", stream="camera0", stage="unsupported_codec") == 2


async def test_malformed_packets_of_a_peer_are_counted_and_media_flow_on() -> None:
    async with running_plane() as plane, viewing(plane, ["video"]) as viewer:
        await stream(plane, viewer, "video", picture, 2)
        peer = cast(Any, viewer.pc.getTransceivers()[0].receiver.transport)
        # REMB that announces more sources than it has: aiortc's router does not expect it.
        short = RtcpPsfbPacket(fmt=15, ssrc=1, media_ssrc=0, fci=b"REMB\x05\x00\x00\x00")
        await peer._send_rtp(bytes(short))
        theirs = cast(Any, viewer.server.getTransceivers()[0].receiver.transport).transport._connection
        theirs._nominated[1].protocol.datagram_received(b"", ("127.0.0.1", 9))
        await peer.transport._send(b"\x80" + bytes(1600))
        await peer.transport._send(b"\x80" + bytes(40))  # not SRTP
        sender = viewer.media._deliveries[0].sender
        nack = RtcpRtpfbPacket(fmt=1, ssrc=1, media_ssrc=sender._ssrc, lost=[1, 2, 3])
        await peer._send_rtp(bytes(nack))
        await viewer.until(lambda: viewer.media.stats[viewer.media.streams[0].mid].not_retransmitted == 3)
        assert value(plane, "malformed_from_peers_total", kind="malformed") == 1
        assert value(plane, "malformed_from_peers_total", kind="datagram_size") == 2
        await stream(plane, viewer, "video", picture, 2, first=3)


async def test_sender_reports_reach_the_peer_and_its_answers_come_back() -> None:
    async with running_plane() as plane, viewing(plane, ["video"]) as viewer:
        await stream(plane, viewer, "video", picture, 2)
        viewer.media.report()
        peer = cast(Any, viewer.pc.getTransceivers()[0].receiver)
        await viewer.until(lambda: bool(peer._RTCRtpReceiver__lsr))
        mid = viewer.media.streams[0].mid
        await viewer.until(lambda: viewer.media.stats[mid].round_trip_ms is not None)
        assert 0 <= cast(float, viewer.media.stats[mid].round_trip_ms) < 2000
        assert viewer.media.stats[mid].packets_lost == 0


async def test_closing_leaves_no_task_and_no_thread() -> None:
    tasks, threads = asyncio.all_tasks(), set(threading.enumerate())
    async with running_plane() as plane, viewing(plane, priority=True) as viewer:
        await stream(plane, viewer, "video", picture, 2)
        await stream(plane, viewer, "audio", sound, 4, first=3)
        await viewer.media.close()
        await viewer.media.close()
    await plane.close()
    await asyncio.sleep(0)
    assert asyncio.all_tasks() == tasks
    left = {thread for thread in threading.enumerate() if thread.name.startswith("media-")}
    assert left <= threads


async def test_a_new_epoch_gets_new_streams_and_starts_its_stamps_afresh() -> None:
    async with running_plane() as plane:
        async with viewing(plane, ["video"]) as viewer:
            await stream(plane, viewer, "video", picture, 2, first=100)
        plane.configure(description(cameras=2))
        async with viewing(plane, ["video", "video"]) as viewer:
            assert [s.stream for s in viewer.media.streams] == ["camera0", "camera1"]
            await stream(plane, viewer, "video", picture, 2)
            assert value(plane, "frames_dropped_total", stream="camera0", stage="stale_stamp") == 0


async def test_a_plane_that_was_never_configured_closes() -> None:
    await MediaPlane(MediaSettings(), CollectorRegistry()).close()


def block(viewer: Viewer) -> Callable[[], None]:
    """Make the server's socket to a viewer look full; returns what makes it look free again."""
    connection = cast(Any, viewer.server.getTransceivers()[0].receiver.transport).transport._connection
    transport = connection._nominated[1].protocol.transport
    original = transport.get_write_buffer_size
    transport.get_write_buffer_size = lambda: 10**9

    def free() -> None:
        transport.get_write_buffer_size = original

    return free


async def test_a_blocked_observer_delays_nobody_and_goes_on_with_a_keyframe() -> None:
    async with AsyncExitStack() as stack:
        plane = await stack.enter_async_context(running_plane())
        operator = await stack.enter_async_context(viewing(plane, ["video"], priority=True))
        observer = await stack.enter_async_context(viewing(plane, ["video"], uris={EVENT_REFERENCE_URI: 9}))
        await stream(plane, operator, "video", picture, 2)
        await observer.until(lambda: timestamps(observer, "video") == 2)
        free = block(observer)
        await stream(plane, operator, "video", picture, 10, first=3)
        assert timestamps(observer, "video") == 2
        assert observer.media.dropped > 0
        assert operator.media.dropped == 0
        assert value(plane, "frames_dropped_total", stream="camera0", stage="peer_busy") == observer.media.dropped
        free()
        await stream(plane, operator, "video", picture, 30, first=13)
        await observer.until(lambda: read_stamp("native", observer.received[-1]) == 42)
        resumed = next(r for r in observer.of("video") if cast(int, read_stamp("native", r)) > 2)
        assert resumed.packet.payload[0] & 0x1F == 24  # parameter sets: a keyframe
        numbers = [received.packet.sequence_number for received in observer.of("video")]
        assert [(n - numbers[0]) % 65536 for n in numbers] == list(range(len(numbers)))


async def test_the_operators_packets_leave_before_feed_of_the_next_picture_and_before_observers() -> None:
    sent: list[str] = []
    async with AsyncExitStack() as stack:
        plane = await stack.enter_async_context(running_plane())
        viewers = [await stack.enter_async_context(viewing(plane, ["video"], priority=i == 3)) for i in range(4)]
        for i, viewer in enumerate(viewers):
            sender = cast(Any, viewer.media._deliveries[0].sender)

            def spy(frame: Any, i: int = i, transmit: Any = sender.transmit) -> Any:
                sent.append("operator" if i == 3 else "observer")
                return transmit(frame)

            sender.transmit = spy
        for i in range(1, 6):
            await stream(plane, viewers[0], "video", noise, 1, first=i)
            for viewer in viewers:
                await viewer.until(lambda viewer=viewer, i=i: timestamps(viewer, "video") == i)  # type: ignore[misc]
        assert sent == ["operator", "observer", "observer", "observer"] * 5
