"""No picture of an attached camera is ever stamped with a newer event than held when it was captured."""

from pathlib import Path

import pytest

from lockstep.bench.harness.free_port import free_port
from lockstep.client import Console
from tests.server.media.numbered_pictures import OF_USE, events_behind, shown_while_driving
from tests.server.media.sources.live_sender import LiveSender
from tests.support.stack import running_stack

SHOWN = 45  # pictures to be looked at
LATENCY = 0.15  # s; the sender encodes in some milliseconds, and a demuxer holds one picture back


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
                shown, newest = await shown_while_driving(console, "street", SHOWN, 40)
                codecs = {stream.stream: stream.codec for stream in console.stats().streams}
        assert codecs["street"] == codec
        behind = await events_behind(stack, shown, newest, sender.captured)
        assert sorted(behind)[len(behind) // 2] <= OF_USE  # and it is not of use to nobody
