"""The whole media path with real peers on loopback: bad input and failures are counted, and media flow on."""

import asyncio
from typing import Any, NoReturn, cast

import pytest
from aiortc.rtp import RtcpPsfbPacket, RtcpRtpfbPacket

from lockstep.rtc.endpoint import Endpoint
from lockstep.server.media.codecs.packetise import packetise_sound
from lockstep.server.media.codecs.picture_encoder import H264Encoder
from lockstep.server.media.codecs.sound_encoder import OpusEncoder
from lockstep.server.media.pipeline.admission import MAX_AT_ONCE
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.rtp_sender import RtpSender
from tests.server.media.feeding import refused, stream, value
from tests.server.media.viewer import TIMEOUT, description, picture, running_plane, sender_of, sound, viewing


async def test_a_medium_older_than_the_one_before_is_dropped_and_counted() -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        await stream(hub, viewer, "video", picture, 2, first=5)
        hub.feed(picture(4, 1.0), 1.0)
        assert value(hub, "frames_dropped_total", stream="camera0", stage="stale_stamp") == 1


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
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        await refused(hub, picture(1, 0.0, **changes))
        await stream(hub, viewer, "video", picture, 1, first=2)
        assert value(hub, "frames_dropped_total", stream="camera0", stage=stage) == 1


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
    async with running_plane() as hub, viewing(hub, ["audio"]) as viewer:
        await refused(hub, sound(1, 0.0, **changes))
        await stream(hub, viewer, "audio", sound, 4, first=2)
        assert value(hub, "frames_dropped_total", stream="microphone0", stage=stage) == 1


async def test_no_more_sound_is_taken_than_time_passes_and_what_comes_in_time_goes_on() -> None:
    async with running_plane() as hub, viewing(hub, ["audio"]) as viewer:
        endless = sound(1, 0.0, payload=bytes(2 * 16_000 * 600))  # ten minutes, which would be thirty thousand packets
        hub.feed(endless, 0.0)
        await stream(hub, viewer, "audio", sound, 4, first=2)
        for number in range(300):
            hub.feed(sound(10, 1.0 + number / 1000), 1.0)
        assert value(hub, "frames_dropped_total", stream="microphone0", stage="too_often") > 200


async def test_of_pictures_no_more_are_taken_than_any_camera_makes() -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        for number in range(int(MAX_AT_ONCE) + 100):
            hub.feed(picture(1, number / 10_000), 0.0)
        assert value(hub, "frames_dropped_total", stream="camera0", stage="too_often") == 100
        hub.feed(picture(2, 10.0), 10.0)
        await viewer.until(lambda: bool(viewer.of("video")))
        assert value(hub, "frames_dropped_total", stream="camera0", stage="too_often") == 100


@pytest.mark.parametrize("time", [float("nan"), float("inf"), -1.0, 1e300])
async def test_an_impossible_capture_time_is_counted(time: float) -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        hub.feed(picture(1, time), 0.0)
        await stream(hub, viewer, "video", picture, 1, first=2)
        assert value(hub, "frames_dropped_total", stream="camera0", stage="bad_time") == 1


async def test_a_keyframe_that_failed_is_tried_again() -> None:
    async with running_plane(keyframe_spacing_seconds=0.0) as hub, viewing(hub, ["video"]) as viewer:
        await stream(hub, viewer, "video", picture, 1)
        async with viewing(hub, ["video"]) as second:
            await refused(hub, picture(2, 0.04, payload=b"short"))  # would have been the joiner's keyframe
            await stream(hub, second, "video", picture, 1, first=3)


async def test_a_worker_that_fails_is_reported_once_counted_and_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        worker = cast(Any, hub)._streams["camera0"].worker
        encode, failed = worker.encoder.encode, worker._failed
        failures = asyncio.Queue[None]()

        def fail(job: Any) -> Any:
            raise MemoryError

        def count(error: Exception) -> None:
            failed(error)
            failures.put_nowait(None)

        worker.encoder.encode, worker._failed = fail, count
        for i in range(1, 4):
            hub.feed(picture(i, i / 30), i / 30)
            async with asyncio.timeout(TIMEOUT):
                await failures.get()
        worker.encoder.encode = encode
        await stream(hub, viewer, "video", picture, 2, first=50)
        assert value(hub, "frames_dropped_total", stream="camera0", stage="worker_failed") == 3
        assert (
            len([record for record in caplog.records if record.name == "lockstep.server.media.encoding.encoder_worker"])
            == 1
        )


async def test_an_unknown_stream_is_counted() -> None:
    async with running_plane() as hub:
        hub.feed(picture(1, 0.0, "no such camera"), 0.0)
        assert value(hub, "frames_dropped_total", stream="", stage="unknown_stream") == 1


async def test_h264_of_the_robot_that_makes_no_sense_is_counted() -> None:
    async with running_plane() as hub, viewing(hub, ["video"], codecs=["VP8"]) as viewer:
        delta = picture(1, 0.0, codec="h264", payload=b"\x00\x00\x00\x01\x61delta", keyframe=False)
        key = picture(2, 0.1, codec="h264", payload=b"\x00\x00\x00\x01\x65key", keyframe=True)
        empty = picture(3, 0.2, codec="h264", payload=b"no start code")
        hub.feed(delta, 0.0)  # no decoder needs to look at it, as nothing came on which it could build
        assert value(hub, "frames_dropped_total", stream="camera0", stage="no_reference") == 1
        await refused(hub, key)
        hub.feed(empty, 0.2)  # nor at this
        assert value(hub, "frames_dropped_total", stream="camera0", stage="bad_payload") == 2
        await stream(hub, viewer, "video", picture, 2, first=20)


async def test_malformed_packets_of_a_peer_are_counted_and_media_flow_on() -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        await stream(hub, viewer, "video", picture, 2)
        peer = cast(Any, viewer.pc.getTransceivers()[0].receiver.transport)
        # REMB that announces more sources than it has
        short = RtcpPsfbPacket(fmt=15, ssrc=1, media_ssrc=0, fci=b"REMB\x05\x00\x00\x00")
        await peer._send_rtp(bytes(short))
        await peer.transport._send(b"\x80" + bytes(1600))
        await peer.transport._send(b"\x80" + bytes(40))  # not SRTP
        nack = RtcpRtpfbPacket(fmt=1, ssrc=1, media_ssrc=viewer.ssrc, lost=[1, 2, 3])
        await peer._send_rtp(bytes(nack))
        await viewer.until(lambda: viewer.stats.not_retransmitted == 3)
        dropped = viewer.connection.peer.dropped
        assert (dropped["rtcp_malformed"], dropped["srtp_malformed"] + dropped["srtp_authentication"]) == (1, 2)
        await stream(hub, viewer, "video", picture, 2, first=3)


async def test_a_picture_encoder_that_fails_starts_afresh(monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        with monkeypatch.context() as patch:
            patch.setattr(H264Encoder, "_open", refuse)
            await refused(hub, picture(1, 0.0))
        assert value(hub, "frames_dropped_total", stream="camera0", stage="encode_failed") == 1
        await stream(hub, viewer, "video", picture, 2, first=30)


async def test_a_sound_encoder_that_fails_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_plane() as hub, viewing(hub, ["audio"]) as viewer:
        with monkeypatch.context() as patch:
            patch.setattr(OpusEncoder, "_compress", refuse)
            await refused(hub, sound(1, 0.0))
            await refused(hub, sound(1, 0.02))
        assert value(hub, "frames_dropped_total", stream="microphone0", stage="encode_failed") == 1
        await stream(hub, viewer, "audio", sound, 4, first=3)


def refuse(*args: Any) -> NoReturn:
    raise ValueError("no")


async def test_a_sender_without_a_path_sends_nothing() -> None:
    frame = EncodedFrame(b"x", packetise_sound, keyframe=True, marker=True, stamp=1, capture_time=0.0, media_time=0)
    async with running_plane() as hub:
        async with viewing(hub, ["video"]) as viewer:
            sender = sender_of(viewer)
        assert sender.transmit(frame) is None, "its connection has ended"
        async with Endpoint(["127.0.0.1"]) as endpoint:
            new = RtpSender(endpoint.connect(controlling=False), "0", "none", video=True, wall_clock=0.0)
            assert new.transmit(frame) is None, "it has no connection yet"
            assert new.stats.packets == 0
            assert not new.paced


async def test_a_failure_is_told_to_a_later_listener_too_and_is_not_an_end() -> None:
    told: list[str] = []
    async with running_plane() as hub, viewing(hub, ["video"]) as viewer:
        viewer.media.failed("planted", RuntimeError("planted"))
        viewer.media.ending.on_ended(lambda: told.append("ended"))
        viewer.media.on_failed(lambda stage, error: told.append(stage))
        assert told == ["planted"]
        hub.configure(description())
    assert told == ["planted"]
