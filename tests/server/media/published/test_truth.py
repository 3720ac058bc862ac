"""No published picture is ever stamped with a newer event than held when it was captured, on any path."""

import asyncio
from bisect import bisect_right
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest

from bench.driving import drive_on
from bench.emulator.client_paths import ClientPaths
from bench.emulator.deliveries import Deliveries
from bench.emulator.outages import Outages
from bench.emulator.profile import load_profile
from bench.emulator.udp_relay import UdpRelay
from client import Console
from robot_bridge.robots.event_strip import read_event_strip
from tests.client.truth import until_logged
from tests.server.media.published.publishing import TestPublisher
from tests.server.media.sources.test_truth import truth
from tests.support.stack import Stack, running_stack

SHOWN = 40  # pictures to be looked at
LATENCY = 0.1  # s; the publisher encodes in some milliseconds


@asynccontextmanager
async def publishing(stack: Stack, codec: str, network: str) -> AsyncIterator[TestPublisher]:
    """Through an emulated network; only media pass it, HTTP does not."""
    deliveries = Deliveries()
    relay = UdpRelay(ClientPaths(load_profile(network), "1", Outages()), deliveries)
    headers = {"Authorization": f"Bearer {stack.operator.partition('#token=')[2]}", "Content-Type": "application/sdp"}
    try:
        async with (
            TestPublisher(codec) as publisher,
            httpx.AsyncClient(base_url=stack.console, trust_env=False) as http,
        ):
            offer = relay.offer(await publisher.offer())
            answer = await http.post("/whip?camera=street", content=offer, headers=headers, timeout=30)
            assert answer.status_code == 201, answer.text
            await publisher.take(relay.answer(answer.text))
            yield publisher
    finally:
        relay.close()
        deliveries.close()


@pytest.mark.timeout(90)
@pytest.mark.parametrize(("codec", "network"), [("H264", "perfect"), ("VP8", "satellite")])
async def test_a_published_picture_never_carries_a_newer_stamp_than_the_truth(
    tmp_path: Path, codec: str, network: str
) -> None:
    extra = ("--whip", f"street#latency={LATENCY}", "--quiet")
    async with running_stack(tmp_path, extra=extra) as stack, publishing(stack, codec, network) as publisher:
        async with Console(stack.operator, gate="off", audio=False) as console:
            await console.take_seat()
            shown: list[tuple[int, int | None]] = []

            async def watch() -> None:
                async for picture in console.pictures("street", keep=50):
                    number = read_event_strip(picture.frame.to_ndarray(format="gray"))
                    if number is not None:
                        shown.append((number, picture.stamp))

            watching = asyncio.create_task(watch())
            try:
                async with asyncio.timeout(60):
                    while len(shown) < SHOWN:
                        feedback = await drive_on(console, {"base.wz": 0.2})
            finally:
                watching.cancel()
        await until_logged(stack, "feedback", lambda record: record["event"] >= feedback.event)
        times, events = truth(stack)
        assert len({stamp for _, stamp in shown}) > 5
        behind = []
        for number, stamp in shown:
            assert stamp is not None
            held = events[bisect_right(times, publisher.pictures.captured[number]) - 1]
            assert stamp <= held, f"picture {number} says {stamp}, and {held} held"
            behind.append(held - stamp)
        assert network != "perfect" or sorted(behind)[len(behind) // 2] <= 5  # and it is of use where it can be
