"""No published picture is ever stamped with a newer event than held when it was captured, on any path."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest

from lockstep.client import Console
from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.impairment.outages import Outages
from lockstep.emulator.impairment.profile import load_profile
from lockstep.emulator.transport.client_paths import ClientPaths
from lockstep.emulator.transport.udp_forwarder import UdpForwarder
from tests.server.media.numbered_pictures import OF_USE, events_behind, shown_while_driving
from tests.server.media.published.publishing import TestPublisher
from tests.support.stack import Stack, running_stack

SHOWN = 40  # pictures to be looked at
LATENCY = 0.1  # s; the publisher encodes in some milliseconds


@asynccontextmanager
async def publishing(stack: Stack, codec: str, network: str) -> AsyncIterator[TestPublisher]:
    """Through an emulated network; only media pass it, HTTP does not."""
    deliveries = Deliveries()
    relay = UdpForwarder(ClientPaths(load_profile(network), "1", Outages()), deliveries)
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


@pytest.mark.parametrize(("codec", "network"), [("H264", "perfect"), ("VP8", "satellite")])
async def test_a_published_picture_never_carries_a_newer_stamp_than_the_truth(
    tmp_path: Path, codec: str, network: str
) -> None:
    extra = ("--whip", f"street#latency={LATENCY}", "--quiet")
    async with running_stack(tmp_path, extra=extra) as stack, publishing(stack, codec, network) as publisher:
        async with Console(stack.operator, gate="off", audio=False) as console:
            await console.take_seat()
            shown, newest = await shown_while_driving(console, "street", SHOWN, 60)
        behind = await events_behind(stack, shown, newest, publisher.pictures.captured)
        assert network != "perfect" or sorted(behind)[len(behind) // 2] <= OF_USE  # and it is of use where it can be
