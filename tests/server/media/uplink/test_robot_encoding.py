"""A hub asks a robot that encodes: what, when, and what happens to pictures that cannot be trusted."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from prometheus_client import CollectorRegistry

from lockstep.protocol.carriers import EVENT_REFERENCE_URI
from lockstep.protocol.messages import EncodeRequest, Media, StreamRequest
from lockstep.server.media.codecs.h264 import inspect
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.pipeline.stream import VideoStream
from lockstep.server.media.settings import MediaSettings
from tests.server.media.camera_h264 import camera_pictures
from tests.server.media.feeding import timestamps, value
from tests.server.media.viewer import Viewer, description, picture, running_plane, viewing

NATIVE = {EVENT_REFERENCE_URI: 9}


class Robot:
    """Takes requests; its pictures come from the test."""

    def __init__(self, hub: MediaHub, *, encodes: bool = True) -> None:
        self.requests: list[EncodeRequest] = []
        self._hub = hub
        self.encodes = encodes
        hub.robot_encoding.ask_by(self._asked)
        cast(Any, hub.robot_encoding).run = asyncio.Event().wait  # ticks are the test's, on its own clock

    def _asked(self, request: EncodeRequest) -> bool:
        self.requests.append(request)
        return self.encodes

    @property
    def newest(self) -> StreamRequest:
        return self.requests[-1].streams[0]

    def give(self, medium: Media) -> None:
        self._hub.feed(medium, medium.time)
        self._hub.robot_encoding.tick(medium.time)


@asynccontextmanager
async def robot_that_encodes() -> AsyncIterator[tuple[MediaHub, Robot]]:
    async with running_plane() as hub:
        yield hub, Robot(hub)


def encoded(hub: MediaHub, codec: str) -> float:
    return value(hub, "frames_encoded_total", stream="camera0", codec=codec)


def dropped(hub: MediaHub, stage: str) -> float:
    return value(hub, "frames_dropped_total", stream="camera0", stage=stage)


async def show(robot: Robot, viewer: Viewer, media: list[Media]) -> None:
    for medium in media:
        before = timestamps(viewer, "video")
        robot.give(medium)
        await viewer.until(lambda before=before: timestamps(viewer, "video") > before)  # type: ignore[misc]


async def test_a_late_joiner_waits_for_the_robots_keyframe_and_the_console_encodes_nothing() -> None:
    pictures = camera_pictures(12, gop=50)
    async with robot_that_encodes() as (hub, robot):
        for medium in pictures[:4]:
            robot.give(medium)
        before = robot.newest.keyframes
        async with viewing(hub, ["video"], uris=NATIVE) as viewer:
            robot.give(pictures[4])
            assert robot.newest.keyframes == before + 1
            robot.give(pictures[5])
            assert robot.newest.keyframes == before + 1  # one is on its way
            await show(robot, viewer, camera_pictures(6, first=7, gop=50))
            assert encoded(hub, "H264") == 0
            assert encoded(hub, "H264-passed") == 6
            assert inspect(viewer.frames("video")[0]).keyframe


async def test_after_a_lost_picture_the_robot_is_asked_and_the_console_encodes_nothing() -> None:
    pictures = camera_pictures(30, gop=50)
    async with robot_that_encodes() as (hub, robot), viewing(hub, ["video"], uris=NATIVE) as viewer:
        await show(robot, viewer, pictures[:20])
        before, delivery = robot.newest.keyframes, viewer.media.deliveries[0]
        delivery.stream.encodings.request_keyframe(delivery.target, "pli")
        await show(robot, viewer, pictures[20:])
        assert robot.newest.keyframes == before + 1
        assert encoded(hub, "H264") <= 1  # before the console knew that the robot does as it is asked
        assert delivery.target in delivery.stream.encodings.passed.targets  # type: ignore[union-attr]


async def test_a_robot_that_makes_no_keyframe_counts_as_a_camera_that_takes_no_requests() -> None:
    pictures = camera_pictures(150, gop=500)
    async with robot_that_encodes() as (hub, robot), viewing(hub, ["video"], uris=NATIVE) as viewer:
        await show(robot, viewer, pictures[:10])
        delivery = viewer.media.deliveries[0]
        delivery.stream.encodings.request_keyframe(delivery.target, "pli")
        for medium in pictures[10:140]:
            robot.give(medium)
        assert not delivery.stream.encodings.follows
        delivery.stream.encodings.request_keyframe(delivery.target, "pli")
        await show(robot, viewer, pictures[140:])
        await viewer.until(lambda: any(inspect(frame).keyframe for frame in viewer.frames("video")[3:]))


async def test_a_bridge_that_does_not_encode_changes_nothing() -> None:
    async with running_plane() as hub, viewing(hub, ["video"], uris=NATIVE) as viewer:
        robot = Robot(hub, encodes=False)
        await show(robot, viewer, camera_pictures(11))
        assert not viewer.media.deliveries[0].stream.encodings.follows


async def test_nobody_who_watches_means_hardly_any_pictures() -> None:
    async with robot_that_encodes() as (hub, robot):
        robot.give(camera_pictures(1)[0])
        assert (robot.newest.bitrate, robot.newest.frame_rate) == (50_000, 1.0)
        async with viewing(hub, ["video"], uris=NATIVE, priority=True):
            hub.robot_encoding.tick(5.0)
            assert robot.newest.bitrate > 200_000
            assert (robot.newest.frame_rate, robot.newest.scale) == (0.0, 1.0)


async def test_an_uplink_that_makes_pictures_late_is_asked_for_less() -> None:
    async with robot_that_encodes() as (hub, robot), viewing(hub, ["video"], uris=NATIVE, priority=True) as viewer:
        pictures = camera_pictures(90, gop=500)
        await show(robot, viewer, pictures[:30])
        before = robot.newest.bitrate
        for medium in pictures[30:]:
            hub.feed(medium, medium.time + 0.4)
            hub.robot_encoding.tick(medium.time + 0.4)
        assert robot.newest.bitrate < 0.7 * before
        stream = cast(VideoStream, viewer.media.deliveries[0].stream)
        assert stream.encodings.passed is not None
        assert stream.encodings.passed.keyframes.sparing


async def test_observers_cannot_fill_a_full_uplink_with_keyframes_and_the_operator_gets_one_at_once() -> None:
    pictures = camera_pictures(140, gop=500)
    async with (
        robot_that_encodes() as (hub, robot),
        viewing(hub, ["video"], uris=NATIVE, priority=True) as operator,
        viewing(hub, ["video"], uris=NATIVE) as observer,
    ):
        await show(robot, operator, pictures[:30])
        encodings = operator.media.deliveries[0].stream.encodings

        def give(medium: Media) -> None:
            hub.feed(medium, medium.time + 0.4)
            hub.robot_encoding.tick(medium.time + 0.4)

        for medium in pictures[30:90]:
            give(medium)
        assert encodings.passed is not None
        assert encodings.passed.keyframes.sparing
        before, target = robot.newest.keyframes, observer.media.deliveries[0].target
        assert target in encodings.passed.targets
        for medium in pictures[90:110]:
            encodings.request_keyframe(target, "pli")
            give(medium)
        for number in range(110, 130, 2):
            encodings.leave(target)
            give(pictures[number])
            encodings.join("H264", target)
            give(pictures[number + 1])
        assert robot.newest.keyframes == before
        encodings.request_keyframe(operator.media.deliveries[0].target, "pli")
        give(pictures[130])
        assert robot.newest.keyframes == before + 1


async def test_a_vp8_peer_gets_pictures_that_the_console_decodes_and_encodes() -> None:
    async with robot_that_encodes() as (hub, robot), viewing(hub, ["video"], codecs=["VP8"], uris=NATIVE) as viewer:
        await show(robot, viewer, camera_pictures(8, gop=50))
        assert encoded(hub, "VP8") == 8
        assert encoded(hub, "H264-passed") == 0


@pytest.mark.parametrize(
    "payload",
    [b"", b"no start code", b"\x00\x00\x01", b"\x00\x00\x00\x01\x80aaa", b"\x00\x00\x01\x00aaa", bytes(5 << 20)],
)
async def test_what_is_no_picture_is_counted_and_breaks_nothing(payload: bytes) -> None:
    pictures = camera_pictures(12, gop=50)
    async with robot_that_encodes() as (hub, robot), viewing(hub, ["video"], uris=NATIVE) as viewer:
        await show(robot, viewer, pictures[:3])
        robot.give(picture(4, 4 / 30, codec="h264", payload=payload, keyframe=False))
        assert dropped(hub, "bad_payload") == 1
        before = len(viewer.frames("video"))
        for medium in pictures[4:10]:  # they may build on the one that is missing
            robot.give(medium)
        assert dropped(hub, "no_reference") == 6
        assert robot.newest.keyframes >= 1
        await show(robot, viewer, camera_pictures(3, first=14, gop=50))
        assert inspect(viewer.frames("video")[before]).keyframe


async def test_a_flood_of_pictures_breaks_no_chain_of_references() -> None:
    pictures = camera_pictures(300, gop=1000)
    async with robot_that_encodes() as (hub, robot):
        for medium in pictures:
            hub.feed(medium, 1.0)
        lost = dropped(hub, "too_often")
        assert lost > 0
        hub.feed(picture(400, 400 / 30, codec="h264", payload=pictures[1].payload, keyframe=False), 20.0)
        assert dropped(hub, "no_reference") == 1
        robot.give(camera_pictures(1, first=700)[0])
        assert dropped(hub, "no_reference") == 1


NALS = st.builds(
    lambda start, head, body: start + bytes([head]) + body,
    st.sampled_from([b"\x00\x00\x01", b"\x00\x00\x00\x01"]),
    st.integers(0, 255),
    st.binary(max_size=60),
)


@given(st.lists(st.tuples(st.one_of(st.binary(max_size=80), NALS, st.lists(NALS).map(b"".join)), st.booleans())))
@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_no_bytes_of_a_robot_raise_anything(pictures: list[tuple[bytes, bool]]) -> None:
    """All that comes is passed on or counted."""

    async def feed() -> None:
        hub = MediaHub(MediaSettings(), CollectorRegistry())
        hub.configure(description())
        hub.robot_encoding.ask_by(lambda request: True)
        for number, (payload, keyframe) in enumerate(pictures, 1):
            hub.feed(picture(number, number / 30, codec="h264", payload=payload, keyframe=keyframe), number / 30)
            hub.robot_encoding.tick(number / 30)

    asyncio.run(feed())
