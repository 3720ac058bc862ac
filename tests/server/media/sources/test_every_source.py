"""Whatever is attached: its media are stamped with an event that held when they were captured, by the bridge's log."""

import asyncio
import time
from bisect import bisect_right
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest
from prometheus_client import CollectorRegistry

from lockstep.bench.browsers.sound_card import running_sound_card
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.planar import create
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.server.event_clock import EventClock
from lockstep.server.media.sources.source_manager import SourceManager
from lockstep.server.media.sources.source_url import parse_source
from tests.robot_bridge.bridge_helpers import log_lines, operator
from tests.server.media.sources.media_files import film, tone
from tests.server.media.sources.rtsp_server import running_camera, slices_of

WANTED = 40  # media of each source


class Plane:
    """Takes what is delivered, with the latest time at which it can have been captured."""

    def __init__(self, captured: Callable[[Media, float], float]) -> None:
        self.media: list[tuple[Media, float]] = []
        self._captured = captured

    def stream_of(self, source: str) -> str:
        return source

    def feed_local(self, media: Media, now: float) -> None:
        self.media.append((media, self._captured(media, now)))


class Attached:
    """Sources to be attached, and what is known of the capture of what they give; else it was before it came."""

    def __init__(self) -> None:
        self.kind = "video"
        self.texts: list[str] = []
        self.captured: Callable[[Media, float], float] = lambda media, now: now


@asynccontextmanager
async def network_camera(directory: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Attached]:
    async with running_camera() as camera:
        attached = Attached()
        attached.texts = [f"street={camera.url}"]
        attached.captured = lambda media, now: camera.captured[slices_of(media.payload)]
        yield attached


@asynccontextmanager
async def films(directory: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Attached]:
    attached = Attached()
    attached.texts = [
        f"passed=file:{film(directory / 'film.mp4')}",
        f"jpeg=file:{film(directory / 'film.avi', 'mjpeg')}",
        f"decoded=file:{film(directory / 'film.mkv', b_frames=2)}",
    ]
    yield attached


@asynccontextmanager
async def sounds(directory: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Attached]:
    async with running_sound_card(directory) as card:
        monkeypatch.setenv("PULSE_SERVER", card.environment["PULSE_SERVER"])
        attached = Attached()
        attached.kind = "audio"
        attached.texts = [f"tone=file:{tone(directory / 'tone.wav')}", "room=pulse:ears.monitor"]
        yield attached


@pytest.mark.parametrize("attach", [network_camera, films, sounds], ids=["rtsp", "films", "file-sound-and-pulse"])
async def test_no_medium_of_an_attached_source_is_stamped_newer_than_the_truth(
    attach: Callable[..., AbstractAsyncContextManager[Attached]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, clock = tmp_path / "events.jsonl", EventClock()
    async with AsyncExitStack() as stack:
        attached = await stack.enter_async_context(attach(tmp_path, monkeypatch))
        hub = Plane(attached.captured)
        specs = [parse_source("video" if attached.kind == "video" else "audio", text) for text in attached.texts]
        manager = SourceManager(specs, clock, hub, CollectorRegistry(), lambda _: None)
        async with Bridge(create(), BridgeSettings(port=0, event_log=log)) as bridge, operator(bridge) as driver:
            clock.begin(bridge.epoch)
            clock.observe(driver.feedback, time.monotonic())
            running = asyncio.create_task(manager.run())
            try:
                async with asyncio.timeout(60):
                    while not all(delivered(hub, spec.name) >= WANTED for spec in specs):
                        clock.observe(await driver.drive([0.1, 0.0, 0.2]), time.monotonic())
            finally:
                running.cancel()
                await asyncio.gather(running, return_exceptions=True)
    times, events = truth(log)
    for media, captured in hub.media:
        assert media.time <= captured
        assert media.stamp <= events[bisect_right(times, captured) - 1], media.stream
    assert len({media.stamp for media, _ in hub.media}) > 5, "the stamps did not move"


def delivered(hub: Plane, stream: str) -> int:
    return sum(media.stream == stream for media, _ in hub.media)


def truth(log: Path) -> tuple[list[float], list[int]]:
    """When each event began to hold."""
    first: dict[int, float] = {}
    for line in log_lines(log, "feedback"):
        first.setdefault(line["event"], line["time"])  # type: ignore[arg-type]
    return list(first.values()), list(first)
