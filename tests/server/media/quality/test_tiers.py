"""Tiers and quality, end to end: real peers on loopback, what they report is made up."""

import asyncio
from contextlib import AsyncExitStack
from typing import Any, cast

import pytest

from lockstep.protocol.console import Quality, Report, StreamReport
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.quality.encoding_target import EncodingTarget
from lockstep.server.media.quality.tier_plans import LOW_FLOOR_BPS
from tests.server.media.feeding import timestamps, value
from tests.server.media.viewer import HEIGHT, TIMEOUT, WIDTH, Viewer, description, noise, running_plane, viewing


def controller(hub: MediaHub) -> Any:
    return cast(Any, hub)._quality


def encoders(hub: MediaHub) -> int:
    return len(cast(Any, hub)._streams["camera0"].worker.encoder._encoders)


async def show(hub: MediaHub, viewers: list[Viewer], first: int, count: int = 1) -> None:
    """Feed pictures; each was received by all viewers before the next."""
    for i in range(first, first + count):
        before = [timestamps(viewer, "video") for viewer in viewers]
        hub.feed(noise(i, i / 30), i / 30)
        for viewer, seen in zip(viewers, before, strict=True):
            await viewer.until(lambda viewer=viewer, seen=seen: timestamps(viewer, "video") > seen)  # type: ignore[misc]


async def size_of_next(hub: MediaHub, viewer: Viewer, number: int) -> tuple[int, int]:
    """Feeds pictures until one was decoded; its size."""
    track = viewer.pc.getTransceivers()[0].receiver.track
    decoded = asyncio.ensure_future(cast(Any, track).recv())
    for i in range(number, number + 30):
        await show(hub, [viewer], i)
        if decoded.done():
            break
        await asyncio.sleep(0.01)
    async with asyncio.timeout(TIMEOUT):
        frame = await decoded
    return frame.width, frame.height


async def test_observers_on_good_paths_share_one_encoder_and_one_on_a_bad_path_gets_its_own() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        good = await stack.enter_async_context(viewing(hub, ["video"]))
        bad = await stack.enter_async_context(viewing(hub, ["video"]))
        await show(hub, [good, bad], 1, 2)
        assert encoders(hub) == 1
        assert bad.media.tier == "high"
        bad.media.quality.path.rate = 100_000
        for _ in range(11):
            controller(hub).tick()
        assert (good.media.tier, bad.media.tier) == ("high", "low")
        await show(hub, [good, bad], 3, 3)
        assert encoders(hub) == 2
        assert value(hub, "keyframe_requests_total", stream="camera0", cause="tier") == 1
        await bad.media.close()
        await show(hub, [good], 6)
        assert encoders(hub) == 1


class HalfSize:
    """A ladder of one step; the test's pictures are too small for the real one."""

    def plan(self, bitrate_bps: float, frame_rate: float, size: tuple[int, int], now: float) -> EncodingTarget:
        return EncodingTarget(round(bitrate_bps), frame_rate, 0.5)


@pytest.mark.parametrize("codec", ["H264", "VP8"])
async def test_a_peer_that_changes_its_tier_misses_no_picture_and_decodes_the_new_size(codec: str) -> None:
    async with running_plane() as hub, viewing(hub, ["video"], codecs=[codec]) as viewer:
        await show(hub, [viewer], 1, 3)
        quality = viewer.media.quality
        controller(hub)._plans._ladders["low", "camera0"] = HalfSize()
        quality.path.rate = 100_000
        for _ in range(11):
            controller(hub).tick()
        assert quality.tier == "low"
        await show(hub, [viewer], 4, 6)
        sequence = [received.packet.sequence_number for received in viewer.of("video")]
        assert [(later - earlier) % 65536 for earlier, later in zip(sequence, sequence[1:], strict=False)] == [1] * (
            len(sequence) - 1
        )
        times = [received.packet.timestamp for received in viewer.of("video")]
        assert all((later - earlier) % 2**32 < 2**31 for earlier, later in zip(times, times[1:], strict=False))
        while await size_of_next(hub, viewer, 20) != (WIDTH // 2, HEIGHT // 2):
            pass


async def test_an_observer_gets_the_operators_pictures_while_those_are_whole() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        operator = await stack.enter_async_context(viewing(hub, ["video"], priority=True))
        observer = await stack.enter_async_context(viewing(hub, ["video"]))
        await show(hub, [operator, observer], 1, 2)
        assert encoders(hub) == 2
        controller(hub)._whole_since = float("-inf")
        controller(hub).tick()
        await show(hub, [operator, observer], 3, 3)
        assert encoders(hub) == 1
        assert (operator.media.tier, observer.media.tier) == ("operator", "high")
        operator.media.quality.path.limited_at = 0.0
        operator.media.quality.path.rate = 200_000
        controller(hub)._plan_operator(controller(hub).leaders(), 0.0)
        controller(hub).tick()
        await show(hub, [operator, observer], 6, 3)
        assert encoders(hub) == 2


async def test_the_operators_tier_is_for_who_holds_the_seat() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        first = await stack.enter_async_context(viewing(hub, ["video"], priority=True))
        second = await stack.enter_async_context(viewing(hub, ["video"], priority=True))
        supervisor = await stack.enter_async_context(viewing(hub, ["video"]))
        assert [peer.media.tier for peer in (first, second, supervisor)] == ["operator", "operator", "high"]
        supervisor.media.drives(True)
        controller(hub).tick()
        assert [peer.media.tier for peer in (first, second, supervisor)] == ["high", "high", "operator"]
        assert supervisor.media.deliveries[0].target.priority
        supervisor.media.drives(False)
        controller(hub).tick()
        assert [peer.media.tier for peer in (first, second, supervisor)] == ["operator", "operator", "high"]


async def test_what_was_decided_is_told_once() -> None:
    async with running_plane() as hub, viewing(hub, ["video"], priority=True) as viewer:
        told: list[Quality] = []
        viewer.media.on_quality(told.append)
        for _ in range(25):
            controller(hub).tick()
        assert len(told) == 1
        assert [(each.stream, each.tier, each.width, each.height) for each in told[0].streams] == [
            ("camera0", "operator", WIDTH, HEIGHT)
        ]
        viewer.media.quality.path.rate = 80_000
        viewer.media.quality.path.reason = "gap"
        for _ in range(10):
            controller(hub).tick()
        assert [quality.reason for quality in told] == ["", "gap"]


async def test_a_clients_report_of_its_gap_reaches_the_controller() -> None:
    async with running_plane() as hub, viewing(hub, ["video"], priority=True) as viewer:
        path = viewer.media.quality.path
        for lag in (1, 1, 4, 4):
            stream = StreamReport(stream="camera0", carrier="none", stamp=100 - lag, tolerance=4, lag=lag)
            viewer.media.report(Report(event=100, streams=[stream]), 1.0)
        assert path.gap.reports_near == 2


@pytest.mark.parametrize(("events", "near"), [(12, 2), (30, 0)])
async def test_a_gap_counts_less_where_it_grew_because_events_follow_one_another_more_quickly(
    events: int, near: int
) -> None:
    async with running_plane() as hub, viewing(hub, ["video"], priority=True) as viewer:
        path = viewer.media.quality.path
        for number, lag in enumerate((1, 1, 3, 3), 1):  # twice a second
            event = number * events
            stream = StreamReport(stream="camera0", carrier="none", stamp=event - lag, tolerance=4, lag=lag)
            viewer.media.report(Report(event=event, streams=[stream]), number * 0.5)
        assert path.gap.reports_near == near


async def test_receiver_reports_give_loss_and_round_trip() -> None:
    async with running_plane() as hub, viewing(hub, ["video"], priority=True) as viewer:
        assert viewer.media.loss is None
        assert viewer.media.round_trip_ms is None
        await show(hub, [viewer], 1, 3)
        await viewer.until(lambda: viewer.media.round_trip_ms is not None)
        assert viewer.media.loss == 0


async def test_with_quality_off_everybody_gets_one_tier_with_everything() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(quality=False))
        operator = await stack.enter_async_context(viewing(hub, ["video"], priority=True))
        observer = await stack.enter_async_context(viewing(hub, ["video"]))
        await show(hub, [operator, observer], 1, 3)
        assert encoders(hub) == 1


async def test_while_the_operators_path_is_paused_no_picture_is_encoded_for_it() -> None:
    async with running_plane() as hub, viewing(hub, ["video"], priority=True) as viewer:
        await show(hub, [viewer], 1, 2)
        viewer.media.quality.path.paused_until = 1e12
        controller(hub).tick()
        hub.feed(noise(3, 3 / 30), 3 / 30)
        async with asyncio.timeout(TIMEOUT):
            while not value(hub, "frames_dropped_total", stream="camera0", stage="path_busy"):  # noqa: ASYNC110
                await asyncio.sleep(0)
        viewer.media.quality.path.paused_until = 0.0
        controller(hub).tick()
        await show(hub, [viewer], 4)
        assert value(hub, "frames_encoded_total", stream="camera0", codec="H264") == 3


async def test_a_thumbnail_gets_the_first_camera_alone_in_the_lowest_tier_and_stays_there() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane(description(cameras=2)))
        good = await stack.enter_async_context(viewing(hub, ["video"]))
        small = await stack.enter_async_context(viewing(hub, ["video", "audio", "video"], thumbnail=True))
        assert [each.stream for each in small.media.streams] == ["camera0"]
        assert [each.currentDirection for each in small.pc.getTransceivers()] == ["recvonly", "inactive", "inactive"]
        await show(hub, [good, small], 1, 2)
        for _ in range(200):
            controller(hub).tick()
        assert (good.media.tier, small.media.tier) == ("high", "low")
        assert encoders(hub) == 2
        plan = controller(hub)._plans._plans["low", "camera0"]
        assert plan.bitrate_bps <= LOW_FLOOR_BPS


async def test_thumbnails_do_not_lower_the_tier_of_who_watches_over_a_bad_path() -> None:
    async with AsyncExitStack() as stack:
        hub = await stack.enter_async_context(running_plane())
        bad = await stack.enter_async_context(viewing(hub, ["video"]))
        small = await stack.enter_async_context(viewing(hub, ["video"], thumbnail=True))
        await show(hub, [bad, small], 1, 2)
        bad.media.quality.path.rate = 300_000
        for _ in range(11):
            controller(hub).tick()
        assert bad.media.tier == "low"
        assert controller(hub)._plans._plans["low", "camera0"].bitrate_bps > LOW_FLOOR_BPS


class Later:
    """The desk's clock, set on by hand."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def bits(hub: MediaHub, tier: str) -> list[int]:
    """Bits per second that the tier's plans give to two cameras."""
    controller(hub).tick()
    return [controller(hub)._plans._plans[tier, name].bitrate_bps for name in ("camera0", "camera1")]


async def test_the_share_of_a_camera_that_gives_nothing_is_the_others_until_it_gives() -> None:
    async with (
        running_plane(description(cameras=2)) as hub,
        viewing(hub, ["video", "video"], priority=True) as viewer,
    ):
        clock = Later()
        controller(hub)._clock = clock
        viewer.media.quality.path.rate = 300_000
        shared = bits(hub, "operator")
        assert sum(shared) == 300_000, "before the first picture each has its own"
        hub.feed(noise(1, clock.now), clock.now)
        assert bits(hub, "operator") == [300_000, shared[1]], "the other begins with no more than its share"
        hub.feed(noise(2, clock.now, "camera1"), clock.now)
        assert bits(hub, "operator") == shared
        clock.now += 1.9
        hub.feed(noise(3, clock.now, "camera1"), clock.now)
        assert bits(hub, "operator") == shared
        clock.now += 0.2
        assert bits(hub, "operator") == [shared[0], 300_000], "also the main camera's, once it gives none any more"


async def test_an_observers_path_need_not_carry_a_camera_that_gives_nothing() -> None:
    async with (
        running_plane(description(cameras=2), video_bitrate_bps=400_000) as hub,
        viewing(hub, ["video", "video"]) as viewer,
    ):
        clock = Later()
        controller(hub)._clock = clock
        tiers = []
        for camera in ("camera0", "camera1"):
            viewer.media.quality.path.rate = 400_000
            hub.feed(noise(1, clock.now, camera), clock.now)
            for _ in range(11):
                controller(hub).tick()
            tiers.append(viewer.media.quality.tier)
        assert tiers == ["high", "low"]


async def test_the_gap_of_a_camera_that_gives_nothing_says_nothing_of_the_path() -> None:
    async with (
        running_plane(description(cameras=2)) as hub,
        viewing(hub, ["video", "video"], priority=True) as viewer,
    ):
        path = viewer.media.quality.path
        hub.feed(noise(1, 1.0), 1.0)
        for event in range(10, 60, 10):
            now = 10.0 + event
            hub.feed(noise(event, now, "camera1"), now)
            old = StreamReport(stream="camera0", carrier="none", stamp=1, tolerance=4, lag=0)
            new = StreamReport(stream="camera1", carrier="none", stamp=event, tolerance=4, lag=0)
            viewer.media.report(Report(event=event, streams=[old, new]), now)
        assert path.gap.newest == 0
