"""No picture of an attached camera is ever stamped with a newer event than held when it was captured."""

import asyncio
import socket
from bisect import bisect_right
from pathlib import Path

import pytest

from bench.driving import drive_on
from client import Console
from robot_bridge.robots.event_strip import read_event_strip
from tests.client.truth import until_logged
from tests.server.media.sources.live_sender import LiveSender
from tests.support.stack import Stack, running_stack

SHOWN = 45  # pictures to be looked at
LATENCY = 0.15  # s; the sender encodes in some milliseconds, and a demuxer holds one picture back


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def truth(stack: Stack) -> tuple[list[float], list[int]]:
    """When each event began to hold, by the bridge's own log; its clock is this machine's."""
    first: dict[int, float] = {}
    for record in stack.events("feedback"):
        first.setdefault(record["event"], record["time"])
    return list(first.values()), list(first)


@pytest.mark.timeout(90)
@pytest.mark.parametrize("codec", ["H264", "VP8"])
async def test_a_camera_behind_an_unsteady_network_never_carries_a_newer_stamp_than_the_truth(
    tmp_path: Path, codec: str
) -> None:
    url = f"udp://127.0.0.1:{free_port()}?pkt_size=1316"
    source = f"street={url}#latency={LATENCY}"
    async with running_stack(tmp_path, extra=("--camera", source, "--quiet")) as stack:
        with LiveSender(url) as sender:
            async with Console(stack.operator, codec=codec, gate="off", audio=False) as console:
                await console.take_seat()
                shown: list[tuple[int, int | None]] = []

                async def watch() -> None:
                    async for picture in console.pictures("street", keep=50):
                        number = read_event_strip(picture.frame.to_ndarray(format="gray"))
                        if number is not None:
                            shown.append((number, picture.stamp))

                watching = asyncio.create_task(watch())
                try:
                    async with asyncio.timeout(40):
                        while len(shown) < SHOWN:
                            feedback = await drive_on(console, {"base.wz": 0.2})
                finally:
                    watching.cancel()
                codecs = {stream.stream: stream.codec for stream in console.stats().streams}
        await until_logged(stack, "feedback", lambda record: record["event"] >= feedback.event)
        times, events = truth(stack)
        assert codecs["street"] == codec
        assert len({stamp for _, stamp in shown}) > 5
        behind = []
        for number, stamp in shown:
            assert stamp is not None
            held = events[bisect_right(times, sender.captured[number]) - 1]
            assert stamp <= held, f"picture {number} says {stamp}, and {held} held"
            behind.append(held - stamp)
        assert sorted(behind)[len(behind) // 2] <= 4  # and it is not of use to nobody
