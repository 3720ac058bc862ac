"""H.264 of a camera on its way to real peers."""

from contextlib import AsyncExitStack
from typing import Any, cast

import av
import pytest

from lockstep.protocol.carriers import EVENT_REFERENCE_URI
from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.group_of_pictures import MOST_PICTURES, GroupOfPictures
from lockstep.server.media.codecs.h264 import inspect
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.pipeline.stream import VideoStream
from tests.server.media.camera_h264 import camera_pictures
from tests.server.media.feeding import read_stamp, timestamps, value
from tests.server.media.viewer import Viewer, high_profiles, picture, running_plane, viewing

NATIVE = {EVENT_REFERENCE_URI: 9}


async def feed(hub: MediaHub, viewer: Viewer, pictures: list[Media]) -> None:
    """One by one, each when the viewer has the one before."""
    for medium in pictures:
        before = timestamps(viewer, "video")
        hub.feed(medium, medium.time)
        await viewer.until(lambda before=before: timestamps(viewer, "video") > before)  # type: ignore[misc]


def encoded(hub: MediaHub, codec: str) -> float:
    return value(hub, "frames_encoded_total", stream="camera0", codec=codec)


def bodies(stream: bytes) -> list[bytes]:
    return [part for part in stream.split(b"\x00\x00\x01") if part.rstrip(b"\x00")]


async def test_a_cameras_h264_goes_on_as_it_came_from_its_next_keyframe_on() -> None:
    pictures = camera_pictures(12)
    async with running_plane() as hub, viewing(hub, ["video"], uris=NATIVE) as viewer:
        await feed(hub, viewer, pictures)
        frames = viewer.frames("video")
        assert len(frames) == 12
        assert encoded(hub, "H264-passed") == 12  # the first is a keyframe
        assert encoded(hub, "H264") == 0
        for medium, frame in zip(pictures, frames, strict=True):
            sent = [part for part in bodies(medium.payload) if part[0] & 0x1F not in (6, 9)]
            assert [part.rstrip(b"\x00") for part in bodies(frame)] == [part.rstrip(b"\x00") for part in sent]
        assert [read_stamp("native", each) for each in viewer.of("video") if each.packet.marker] == list(range(1, 13))


async def test_a_late_joiner_gets_ours_at_once_and_the_cameras_from_its_keyframe() -> None:
    pictures = camera_pictures(10)
    async with running_plane() as hub:
        for medium in pictures[:3]:
            hub.feed(medium, medium.time)
        async with viewing(hub, ["video"], uris=NATIVE) as viewer:
            await feed(hub, viewer, pictures[3:])
            assert encoded(hub, "H264") == 2
            assert encoded(hub, "H264-passed") == 5
            assert inspect(viewer.frames("video")[0]).keyframe
            stamps = [read_stamp("native", each) for each in viewer.of("video") if each.packet.marker]
            assert stamps == [4, 5, 6, 7, 8, 9, 10]
            context = cast(Any, av.CodecContext.create("h264", "r"))
            context.flags |= av.codec.context.Flags.low_delay
            shades = [
                float(frame.to_ndarray()[100, :20].mean())
                for data in viewer.frames("video")
                for frame in context.decode(av.Packet(data))
            ]
            assert shades == sorted(shades)  # each picture is brighter than the one before
            assert len(shades) == 7


@pytest.mark.parametrize(("codecs", "profile", "codec"), [(["VP8"], "baseline", "VP8"), (["H264"], "high", "H264")])
async def test_who_cannot_take_the_cameras_pictures_gets_ours(codecs: list[str], profile: str, codec: str) -> None:
    async with running_plane() as hub, viewing(hub, ["video"], codecs=codecs, uris=NATIVE) as viewer:
        await feed(hub, viewer, camera_pictures(7, profile=profile))
        assert viewer.media.streams[0].codec == codec
        assert encoded(hub, codec) == 7
        assert encoded(hub, "H264-passed") == 0


async def test_main_and_high_go_to_who_offers_them_once_the_camera_is_known_to_give_h264() -> None:
    pictures = camera_pictures(6, profile="high")
    with high_profiles():
        async with running_plane() as hub:
            hub.feed(pictures[0], 0.0)
            async with viewing(hub, ["video"], codecs=["VP8", "H264"], uris=NATIVE) as viewer:
                await feed(hub, viewer, pictures[1:])
                assert viewer.media.streams[0].codec == "H264"
                assert "profile-level-id=64001f" in viewer.answer
                assert encoded(hub, "H264-passed") == 1  # the second keyframe


async def test_a_lost_picture_is_made_up_for_by_a_keyframe_of_ours() -> None:
    pictures = camera_pictures(11)
    async with running_plane() as hub, viewing(hub, ["video"], uris=NATIVE) as viewer:
        await feed(hub, viewer, pictures[:2])
        delivery = viewer.media.deliveries[0]
        delivery.stream.encodings.request_keyframe(delivery.target, "pli")
        await feed(hub, viewer, pictures[2:4])
        # The camera's own picture and ours come both while the keyframe is made.
        await viewer.until(lambda: any(inspect(frame).keyframe for frame in viewer.frames("video")[2:]))
        await feed(hub, viewer, pictures[4:])
        assert 1 <= encoded(hub, "H264") <= 3
        assert encoded(hub, "H264-passed") >= 8
        assert value(hub, "keyframe_requests_total", stream="camera0", cause="pli") == 1


async def test_a_path_without_room_gets_ours_and_nobody_else_does() -> None:
    pictures = camera_pictures(11)
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(quality=False))  # which would hold nobody back
        narrow = await stack.enter_async_context(viewing(hub, ["video"], uris=NATIVE))
        wide = await stack.enter_async_context(viewing(hub, ["video"], uris=NATIVE))
        stream, target = narrow.media.deliveries[0].stream, narrow.media.deliveries[0].target
        cast(VideoStream, stream).passthrough.hold_back(target, True)
        await feed(hub, wide, pictures)
        await narrow.until(lambda: timestamps(narrow, "video") >= 2)  # ours: what is not encoded in time is left out
        assert encoded(hub, "H264-passed") == 11
        assert encoded(hub, "H264") >= 2
        passed = stream.encodings.passed
        assert passed is not None
        assert list(passed.targets) == [wide.media.deliveries[0].target]


async def test_a_camera_that_gives_other_pictures_is_encoded_from_then_on() -> None:
    async with running_plane() as hub, viewing(hub, ["video"], uris=NATIVE) as viewer:
        await feed(hub, viewer, camera_pictures(3))
        await feed(hub, viewer, [picture(stamp, stamp / 30) for stamp in range(4, 8)])
        assert encoded(hub, "H264-passed") == 3
        assert encoded(hub, "H264") == 4


def test_a_group_is_kept_from_its_keyframe_on_and_within_its_bound() -> None:
    group = GroupOfPictures()

    def added(number: int, *, keyframe: bool = False) -> Media:
        media = picture(number, number / 10, codec="h264", payload=b"picture", keyframe=keyframe)
        group.add(media)
        return media

    assert group.take(added(1)) == ()
    pictures = [added(2, keyframe=True), *map(added, range(3, 7))]
    assert group.take(pictures[2]) == tuple(pictures[:3]), "not the newer ones: they show later events"
    assert group.take(pictures[1]) == (), "it was taken"
    assert group.take(pictures[4]) == tuple(pictures[3:])
    before, key = added(7), added(8, keyframe=True)
    assert group.take(before) == (), "nothing after the keyframe builds on it"
    for number in range(MOST_PICTURES):
        newest = added(number)
    assert (group.take(key), group.take(newest), group.take(added(1))) == ((), (), ())
