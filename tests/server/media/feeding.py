"""What tests of the whole media path do with a plane and its viewers."""

import asyncio
from collections.abc import Callable
from typing import Any, cast

from lockstep.protocol.carriers import (
    CAPTURE_TIME_URI,
    EVENT_REFERENCE_URI,
    Carrier,
    unpack_capture_time,
    unpack_event_reference,
)
from lockstep.protocol.messages import Media
from lockstep.server.media.hub import MediaHub
from tests.server.media.viewer import TIMEOUT, Received, Viewer

Make = Callable[[int, float], Media]


async def stream(hub: MediaHub, viewer: Viewer, kind: str, make: Make, count: int, first: int = 1) -> None:
    """Feed media one by one, each when the one before was received; event i is captured at i / 50 s."""
    for i in range(first, first + count):
        before = timestamps(viewer, kind)
        hub.feed(make(i, i / 50), i / 50)
        if kind == "video" or i > first + 1:  # a resampler keeps some of the first sound back
            await viewer.until(lambda before=before: timestamps(viewer, kind) > before)  # type: ignore[misc]


def timestamps(viewer: Viewer, kind: str) -> int:
    return len({received.packet.timestamp for received in viewer.of(kind) if received.packet.marker or kind == "audio"})


def value(hub: MediaHub, name: str, **labels: str) -> float:
    """A metric of the plane; 0 before it first counted."""
    registry = cast(Any, hub).registry
    return registry.get_sample_value(f"lockstep_media_{name}", labels) or 0.0


async def refused(hub: MediaHub, media: Media) -> None:
    """Feed a medium and wait until the stream's worker is through with it."""
    worker = cast(Any, hub)._streams[media.stream].worker
    finish, finished = worker._finish, asyncio.Event()

    def spy(encoded: Any) -> None:
        finish(encoded)
        finished.set()

    worker._finish = spy
    hub.feed(media, media.time)
    async with asyncio.timeout(TIMEOUT):
        await finished.wait()
    worker._finish = finish


def read_stamp(carrier: Carrier, received: Received) -> int | None:
    if carrier == "native":
        return unpack_event_reference(received.extensions[EVENT_REFERENCE_URI])
    return unpack_capture_time(received.extensions[CAPTURE_TIME_URI])
