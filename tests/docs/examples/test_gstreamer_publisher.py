"""The GStreamer publisher of the documents against a console: a stranger's WHIP, in the system's own Python."""

import asyncio
from pathlib import Path

import httpx
import pytest

from lockstep.client import Console
from tests.docs.examples.test_gstreamer import missing, running
from tests.support.stack import running_stack

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "examples" / "gstreamer" / "publish.py"
PATTERN = "videotestsrc is-live=true pattern=ball ! video/x-raw,width=320,height=240,framerate=20/1 ! videoconvert"
NEEDED = ("openh264enc", "vp8enc", "h264parse", "rtph264pay", "rtpvp8pay", "videotestsrc")

pytestmark = [
    pytest.mark.skipif(bool(why := missing(NEEDED)), reason=f"GStreamer is not complete here: {why} missing"),
]


@pytest.mark.parametrize("codec", ["H264", "VP8"])
async def test_a_camera_that_gstreamer_publishes_is_seen_with_its_events_until_it_leaves(
    tmp_path: Path, codec: str
) -> None:
    async with (
        running_stack(tmp_path, extra=("--whip", "phone", "--quiet")) as stack,
        running(str(EXAMPLE), stack.operator, "--source", PATTERN, "--codec", codec) as process,
        Console(stack.observer, gate="off", audio=False) as console,
    ):
        assert process.stdout is not None
        async with asyncio.timeout(50):
            assert (await process.stdout.readline()).decode().startswith("publishing to http")
            seen = 0
            async for picture in console.pictures("phone"):
                assert (picture.frame.width, picture.frame.height) == (320, 240)
                assert picture.stamp is not None
                seen += 1
                if seen >= 20:
                    break
            process.terminate()
            await process.communicate()
            assert process.returncode == 0
        async with httpx.AsyncClient(trust_env=False) as http:
            metrics = (await http.get(f"{stack.console}/metrics")).text
        assert 'lockstep_whip_ended_total{why="deleted"} 1.0' in metrics


async def test_the_example_says_in_words_that_an_observer_publishes_nothing(tmp_path: Path) -> None:
    async with (
        running_stack(tmp_path, extra=("--whip", "phone", "--quiet")) as stack,
        running(str(EXAMPLE), stack.observer, "--source", PATTERN) as process,
    ):
        _, error = await asyncio.wait_for(process.communicate(), 50)
    assert process.returncode == 1
    assert "403" in error.decode()
    assert "not_allowed" in error.decode()
