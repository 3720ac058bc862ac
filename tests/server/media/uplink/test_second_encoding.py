"""Two encodings of one camera: observers who are due more get the second, the operator always the first."""

from typing import Any, cast

import msgspec
import pytest

from lockstep.protocol.carriers import EVENT_REFERENCE_URI
from lockstep.protocol.messages import Media
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.pipeline.stream import VideoStream
from tests.server.media.camera_h264 import camera_pictures
from tests.server.media.feeding import read_stamp, timestamps
from tests.server.media.uplink.test_robot_encoding import Robot
from tests.server.media.viewer import Viewer, running_plane, viewing

NATIVE = {EVENT_REFERENCE_URI: 9}
PICTURES = camera_pictures(200, gop=1)


def stream_of(viewer: Viewer) -> VideoStream:
    return cast(VideoStream, viewer.media.deliveries[0].stream)


class TwoEncodings:
    """A robot that makes the second encoding while it is asked to."""

    def __init__(self, hub: MediaHub, robot: Robot) -> None:
        self._hub, self._robot = hub, robot
        self._pictures = iter(PICTURES)

    def asked(self) -> bool:
        return bool(self._robot.requests) and bool(self._robot.requests[-1].second)

    async def give(self, viewer: Viewer, count: int, *, late: float = 0.0) -> None:
        """Give pictures, each when the viewer has the one before."""
        for _ in range(count):
            medium = next(self._pictures)
            before = timestamps(viewer, "video")
            self._feed(medium, late)
            if self.asked():
                self._feed(msgspec.structs.replace(medium, second=True), late)
            self._hub.robot_encoding.tick(medium.time + late)
            await viewer.until(lambda before=before: timestamps(viewer, "video") > before)  # type: ignore[misc]

    def _feed(self, medium: Media, late: float) -> None:
        self._hub.feed(medium, medium.time + late)


def read_last(viewer: Viewer) -> int | None:
    """The event of the newest picture."""
    return read_stamp("native", viewer.of("video")[-1])


def narrow_operator(hub: MediaHub, *, shown: float = 2e6) -> None:
    """Let the operator's path carry a quarter of what observers are due, and the uplink be known to carry `shown`."""
    encoding = cast(Any, hub.robot_encoding)
    encoding._planned_bps = lambda stream: 200_000
    encoding._uplink.shown = lambda now: shown


async def test_an_observer_gets_the_second_encoding_and_the_operator_the_first() -> None:
    async with running_plane(quality=False, second_encoding=True) as hub:
        robot = Robot(hub)
        narrow_operator(hub)
        async with (
            viewing(hub, ["video"], uris=NATIVE, priority=True) as operator,
            viewing(hub, ["video"], uris=NATIVE) as observer,
        ):
            operator.media.drives(True)
            target = observer.media.deliveries[0].target
            target.tier = "high"
            two = TwoEncodings(hub, robot)
            await two.give(operator, 150)
            assert not two.asked()  # observers were not due more for five seconds
            await two.give(operator, 45)
            assert two.asked()
            encodings = stream_of(operator).encodings
            assert encodings.second is not None
            assert encodings.passed is not None
            assert list(encodings.second.targets) == [target]
            assert list(encodings.passed.targets) == [operator.media.deliveries[0].target]
            request = robot.requests[-1]
            assert request.streams[0].bitrate <= 200_000 < request.second[0].bitrate
            stamps = [read_stamp("native", each) for each in observer.of("video") if each.packet.marker]
            assert None not in stamps
            assert stamps == sorted(filter(None, stamps))


@pytest.mark.parametrize(("is_set", "waits"), [(True, 0.1), (False, 0.0)])
async def test_no_second_is_asked_for_while_media_wait_on_the_uplink_or_where_it_is_not_set(
    is_set: bool, waits: float
) -> None:
    async with running_plane(quality=False, second_encoding=is_set) as hub:
        robot = Robot(hub)
        narrow_operator(hub)
        cast(Any, hub.robot_encoding)._uplink.pictures_wait = lambda now: waits
        async with (
            viewing(hub, ["video"], uris=NATIVE, priority=True) as operator,
            viewing(hub, ["video"], uris=NATIVE) as observer,
        ):
            operator.media.drives(True)
            observer.media.deliveries[0].target.tier = "high"
            await TwoEncodings(hub, robot).give(operator, 195)
            assert not any(request.second for request in robot.requests)


async def test_an_observer_who_is_due_no_more_gets_the_first_again_from_a_keyframe_on() -> None:
    async with running_plane(quality=False, second_encoding=True) as hub:
        robot = Robot(hub)
        narrow_operator(hub)
        async with (
            viewing(hub, ["video"], uris=NATIVE, priority=True) as operator,
            viewing(hub, ["video"], uris=NATIVE) as observer,
        ):
            operator.media.drives(True)
            target = observer.media.deliveries[0].target
            target.tier = "high"
            two = TwoEncodings(hub, robot)
            await two.give(operator, 190)
            assert two.asked()
            encodings = stream_of(operator).encodings
            encodings.move("H264", target, "operator")
            await two.give(operator, 5)
            assert not two.asked()
            assert encodings.second is not None
            assert encodings.passed is not None
            assert not encodings.second.targets
            assert target in encodings.passed.targets


async def test_an_observer_changes_only_with_a_keyframe_that_is_as_new_as_the_picture_it_had_last() -> None:
    async with running_plane(quality=False, second_encoding=True) as hub:
        robot = Robot(hub)
        narrow_operator(hub)
        async with (
            viewing(hub, ["video"], uris=NATIVE, priority=True) as operator,
            viewing(hub, ["video"], uris=NATIVE) as observer,
        ):
            operator.media.drives(True)
            target = observer.media.deliveries[0].target
            target.tier = "high"
            two = TwoEncodings(hub, robot)
            while not two.asked():
                await two.give(operator, 1)
            encodings = stream_of(operator).encodings
            assert encodings.second is not None
            first, second = PICTURES[197:199]
            before = robot.requests[-1].second[0].keyframes
            robot.give(second)
            hub.feed(msgspec.structs.replace(first, second=True), second.time)
            assert target not in encodings.second.targets
            hub.robot_encoding.tick(second.time + 1.0)
            assert robot.requests[-1].second[0].keyframes > before
            hub.feed(msgspec.structs.replace(second, second=True), second.time)
            assert target in encodings.second.targets


async def test_an_observer_that_had_a_later_picture_of_the_second_waits_for_a_keyframe_as_new_of_the_first() -> None:
    async with running_plane(quality=False, second_encoding=True) as hub:
        robot = Robot(hub)
        narrow_operator(hub)
        async with (
            viewing(hub, ["video"], uris=NATIVE, priority=True) as operator,
            viewing(hub, ["video"], uris=NATIVE) as observer,
        ):
            operator.media.drives(True)
            target = observer.media.deliveries[0].target
            target.tier = "high"
            two = TwoEncodings(hub, robot)
            await two.give(operator, 195)
            encodings = stream_of(operator).encodings
            assert encodings.second is not None
            assert encodings.passed is not None
            assert target in encodings.second.targets
            first, second, third = PICTURES[195:198]
            # The first encoding is larger, and so later on the uplink.
            hub.feed(msgspec.structs.replace(second, second=True), second.time)
            encodings.move("H264", target, "operator")
            before = robot.requests[-1].streams[0].keyframes
            robot.give(first)
            assert target not in encodings.passed.targets
            hub.robot_encoding.tick(second.time + 1.0)
            assert robot.requests[-1].streams[0].keyframes > before
            robot.give(third)
            assert target in encodings.passed.targets
            await observer.until(lambda: read_last(observer) == third.stamp)
            stamps = [read_stamp("native", each) for each in observer.of("video") if each.packet.marker]
            assert stamps == sorted(filter(None, stamps))


async def test_second_pictures_that_nobody_asked_for_go_nowhere() -> None:
    async with (
        running_plane(quality=False, second_encoding=True) as hub,
        viewing(hub, ["video"], uris=NATIVE) as viewer,
    ):
        robot = Robot(hub)
        for medium in PICTURES[:5]:
            hub.feed(msgspec.structs.replace(medium, second=True), medium.time)
        robot.give(PICTURES[5])
        await viewer.until(lambda: timestamps(viewer, "video") > 0)
        assert timestamps(viewer, "video") == 1
        assert stream_of(viewer).size == (PICTURES[5].width, PICTURES[5].height)


async def test_after_a_second_picture_that_was_dropped_observers_get_none_that_builds_on_it() -> None:
    async with running_plane(quality=False, second_encoding=True) as hub:
        robot = Robot(hub)
        narrow_operator(hub)
        async with (
            viewing(hub, ["video"], uris=NATIVE, priority=True) as operator,
            viewing(hub, ["video"], uris=NATIVE) as observer,
        ):
            operator.media.drives(True)
            observer.media.deliveries[0].target.tier = "high"
            two = TwoEncodings(hub, robot)
            await two.give(operator, 190)
            stream = stream_of(operator)
            came: list[float] = []
            stream.second.came = came.append
            flood = msgspec.structs.replace(PICTURES[190], second=True, keyframe=False)
            for _ in range(300):  # more than any camera makes
                hub.feed(flood, flood.time)
            before = list(came)
            hub.feed(msgspec.structs.replace(flood, time=flood.time + 1.0), flood.time + 1.0)
            assert came == before
            await two.give(operator, 1)  # which is a keyframe
            assert len(came) == len(before) + 1
