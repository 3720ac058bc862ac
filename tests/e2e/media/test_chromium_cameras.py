"""Cameras of the console's own in real Chromium, among them one that is not there."""

from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import open_console
from tests.server.media.sources.media_files import film, tone
from tests.support.stack import running_stack

pytestmark = pytest.mark.browser


async def test_attached_media_are_shown_and_what_fails_is_said(tmp_path: Path, chromium: Browser) -> None:
    extra = (
        *(
            "--camera",
            f"door=file:{film(tmp_path / 'door.mp4')}",
            "--camera",
            f"yard=file:{film(tmp_path / 'y.avi', 'mjpeg')}",
        ),
        *(
            "--camera",
            "gate=rtsp://viewer:geheim@127.0.0.1:1/x",
            "--microphone",
            f"hall=file:{tone(tmp_path / 't.wav')}",
        ),
    )
    async with (
        running_stack(tmp_path, extra=(*extra, "--quiet")) as stack,
        open_console(chromium, stack.operator) as console,
    ):
        await console.until("s.streams.door.rendered > 20 && s.streams.yard.rendered > 20")
        await console.until("s.streams.door.width === 160")  # a machine that was busy at the start has them smaller
        await console.until("s.streams.hall.received > 20 && s.streams.microphone.received > 20")
        stats = (await console.stats())["streams"]
        assert stats["door"]["codec"] == "H264"
        assert (stats["door"]["width"], stats["door"]["height"]) == (160, 120)
        assert stats["door"]["stamp"] == 1
        assert {stats[name]["violations"] for name in ("door", "yard", "hall")} == {0}
        await console.page.locator("[data-view=gate]").get_by_text("Reconnecting… (connection refused)").wait_for()
        assert "geheim" not in await console.page.content()
        async with httpx.AsyncClient(trust_env=False) as http:
            metrics = (await http.get(f"{stack.console}/metrics")).text
        assert 'lockstep_media_frames_encoded_total{codec="H264-passed",stream="door"}' in metrics
        assert not any("geheim" in line for line in stack.output)
