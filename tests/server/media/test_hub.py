"""The whole media path with real peers on loopback: what is negotiated and what arrives."""

import asyncio
from contextlib import AsyncExitStack
from typing import Any, cast

import pytest
from aiortc.rtp import RtcpPsfbPacket, pack_remb_fci
from prometheus_client import CollectorRegistry

from lockstep.protocol.carriers import CAPTURE_TIME_URI, EVENT_REFERENCE_URI, PLAYOUT_DELAY_URI, Carrier, split_trailer
from lockstep.server.media.hub import MediaHub, MediaSettings
from tests.server.media.feeding import read_stamp, stream, timestamps, value
from tests.server.media.viewer import TIMEOUT, description, noise, picture, running_plane, sender_of, sound, viewing


@pytest.mark.parametrize("codec", ["H264", "VP8"])
@pytest.mark.parametrize(("carrier", "uri"), [("native", EVENT_REFERENCE_URI), ("capture-time", CAPTURE_TIME_URI)])
async def test_every_video_packet_carries_the_stamp_of_its_picture(codec: str, carrier: Carrier, uri: str) -> None:
    async with running_plane() as hub, viewing(hub, ["video"], codecs=[codec], uris={uri: 9}) as viewer:
        assert [(s.codec, s.carrier) for s in viewer.media.streams] == [(codec, carrier)]
        await stream(hub, viewer, "video", noise, 8)
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
    async with running_plane() as hub, viewing(hub, ["audio"], codecs=[codec], uris={uri: 9}) as viewer:
        assert [(s.codec, s.carrier) for s in viewer.media.streams] == [(codec, carrier)]
        await stream(hub, viewer, "audio", sound, 12)
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
    async with running_plane() as hub, viewing(hub, [kind], codecs=[codec], trailer=True) as viewer:
        assert [s.carrier for s in viewer.media.streams] == ["trailer"]
        await stream(hub, viewer, kind, make, 8)
        for i, frame in enumerate(viewer.frames(kind)):
            rest, trailer = split_trailer(frame)
            assert trailer is not None
            assert trailer.event in (i, i + 1)
            assert rest


async def test_a_peer_gets_only_what_its_offer_asked_for() -> None:
    everything = {EVENT_REFERENCE_URI: 9, CAPTURE_TIME_URI: 10, PLAYOUT_DELAY_URI: 11}
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        plain = await stack.enter_async_context(viewing(hub, ["video"]))
        native = await stack.enter_async_context(viewing(hub, ["video"], uris=everything))
        trailer = await stack.enter_async_context(viewing(hub, ["video"], uris=everything, trailer=True))
        assert [v.media.streams[0].carrier for v in (plain, native, trailer)] == ["none", "native", "trailer"]
        await stream(hub, plain, "video", noise, 3)
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
    async with running_plane() as hub, viewing(hub, ["audio"], uris={PLAYOUT_DELAY_URI: 9}) as viewer:
        await stream(hub, viewer, "audio", sound, 4)
        assert all(PLAYOUT_DELAY_URI not in received.extensions for received in viewer.of("audio"))


async def test_surplus_sections_are_inactive_and_names_travel_in_the_answer() -> None:
    kinds = ["video", "audio", "video", "video", "audio"]
    async with running_plane(description(cameras=2)) as hub, viewing(hub, kinds) as viewer:
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
        hub.feed(picture(1, 1.0, "camera1"), 1.0)
        await viewer.until(lambda: bool(viewer.received))


@pytest.mark.parametrize("order", [["H264", "VP8"], ["VP8", "H264"]])
async def test_the_offers_order_decides_the_codec(order: list[str]) -> None:
    async with running_plane() as hub, viewing(hub, ["video"], codecs=order) as viewer:
        assert viewer.media.streams[0].codec == order[0]


async def test_a_section_without_a_codec_in_common_is_inactive() -> None:
    async with running_plane() as hub, viewing(hub, ["video", "audio"], codecs=["H264", "PCMA"]) as viewer:
        assert [s.stream for s in viewer.media.streams] == ["camera0"]


@pytest.mark.parametrize("codec", ["H264", "VP8"])
async def test_pictures_are_decoded_by_the_peer(codec: str) -> None:
    async with running_plane() as hub, viewing(hub, ["video"], codecs=[codec]) as viewer:
        track = viewer.pc.getTransceivers()[0].receiver.track
        await stream(hub, viewer, "video", picture, 5)
        async with asyncio.timeout(TIMEOUT):
            frame = await track.recv()
        assert abs(int(cast(Any, frame).to_ndarray()[60, 80]) - 21) < 4


async def test_sender_reports_reach_the_peer_and_its_answers_come_back() -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        await stream(hub, viewer, "video", picture, 2)
        peer = cast(Any, viewer.pc.getTransceivers()[0].receiver)
        await viewer.until(lambda: bool(peer._RTCRtpReceiver__lsr))
        await viewer.until(lambda: viewer.stats.round_trip_ms is not None)
        assert 0 <= cast(float, viewer.stats.round_trip_ms) < 2000
        assert viewer.stats.packets_lost == 0


async def test_a_new_epoch_gets_new_streams_and_starts_its_stamps_afresh() -> None:
    async with running_plane() as hub:
        async with viewing(hub, ["video"]) as viewer:
            await stream(hub, viewer, "video", picture, 2, first=100)
        hub.configure(description(cameras=2))
        async with viewing(hub, ["video", "video"]) as viewer:
            assert [s.stream for s in viewer.media.streams] == ["camera0", "camera1"]
            await stream(hub, viewer, "video", picture, 2)
            assert value(hub, "frames_dropped_total", stream="camera0", stage="stale_stamp") == 0


async def test_a_peer_is_told_once_when_an_epoch_ends_its_streams_and_also_when_it_asks_late() -> None:
    told: list[str] = []
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer, viewing(hub, ["video"]) as leaver:
        viewer.media.ending.on_ended(lambda: told.append("early"))
        leaver.media.ending.on_ended(lambda: told.append("left"))
        await leaver.media.close()
        hub.configure(description())
        viewer.media.ending.on_ended(lambda: told.append("late"))
        assert told == ["early", "late"]


async def test_a_plane_that_was_never_configured_ends() -> None:
    running = asyncio.create_task(MediaHub(MediaSettings(), CollectorRegistry()).run())
    await asyncio.sleep(0)
    running.cancel()
    with pytest.raises(asyncio.CancelledError):
        await running


async def test_bandwidth_estimates_are_kept_for_the_stream_they_are_about() -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        for bitrate, ssrc in ((700_000, viewer.ssrc), (5, viewer.ssrc ^ 1)):
            fci = pack_remb_fci(bitrate, [ssrc])
            viewer.tell(bytes(RtcpPsfbPacket(fmt=15, ssrc=1, media_ssrc=0, fci=fci)))
        assert sender_of(viewer).stats.remb_bps == 700_000
