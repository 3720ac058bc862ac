"""The GStreamer client of the documents against a console: a stranger's WebRTC, in the system's own Python."""

import asyncio
import base64
import json
import re
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509 import load_pem_x509_certificate

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from tests.support.stack import Stack, running_stack

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "docs" / "examples" / "gstreamer" / "watch.py"
SCREEN = Path(__file__).with_name("gstreamer_screen.py")
PYTHON = "/usr/bin/python3"  # GStreamer's bindings are a package of the system
NEEDED = ("webrtcbin", "nicesrc", "dtlsdec", "sctpdec", "rtpvp8depay", "vp8dec", "textoverlay", "appsink")
ASK = "import gi; gi.require_version('GstWebRTC', '1.0'); from gi.repository import Gst, GstWebRTC; Gst.init(None); \
print(*[each for each in {!r} if Gst.ElementFactory.find(each) is None])"
LINE = re.compile(r"event \d+, gap -?\d+, (shown|left out)")


def missing(needed: tuple[str, ...] = NEEDED) -> str:
    """What of GStreamer is not on this machine; "" where all is."""
    try:
        found = subprocess.run([PYTHON, "-c", ASK.format(needed)], capture_output=True, text=True, timeout=30)
    except OSError:
        return PYTHON
    return found.stdout.strip() if found.returncode == 0 else "python3-gi or GStreamer's libraries"


pytestmark = pytest.mark.skipif(bool(why := missing()), reason=f"GStreamer is not complete here: {why} missing")


@pytest.fixture
async def stack(tmp_path: Path) -> AsyncIterator[Stack]:
    async with running_stack(tmp_path) as running:
        yield running


@asynccontextmanager
async def running(*command: str) -> AsyncIterator[asyncio.subprocess.Process]:
    process = await asyncio.create_subprocess_exec(
        *(PYTHON, *command), stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE, limit=2**20
    )
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
        await process.communicate()


async def lines(process: asyncio.subprocess.Process) -> AsyncIterator[dict[str, Any]]:
    assert process.stdout is not None
    async for line in process.stdout:
        yield json.loads(line)


async def turn(console: Console) -> None:
    """Drive until cancelled: every command is an event."""
    while True:
        await drive_on(console, [0.0, 0.4, *([0.0] * (len(console.description.axes) - 2))])


async def until_alone(console: Console) -> None:
    while any(each.role == "observer" for each in console.participants):  # noqa: ASYNC110  nothing tells of it
        await asyncio.sleep(0.05)


def drawn_in(shown: dict[str, Any]) -> int | None:
    """The event in the pixels of a picture on the screen."""
    luma = np.zeros((shown["height"], shown["width"]), np.uint8)
    band = np.frombuffer(base64.b64decode(shown["band"]), np.uint8).reshape(-1, shown["stride"])
    luma[: len(band)] = band[:, : shown["width"]]
    return read_event_strip(luma)


async def test_the_example_shows_pictures_of_the_event_that_it_names_and_none_beyond_the_tolerance(
    stack: Stack,
) -> None:
    shown: list[dict[str, Any]] = []
    judged: list[dict[str, Any]] = []
    certificate = ""
    async with (
        asyncio.timeout(50),
        Console(stack.operator, video=0, audio=False) as console,
        running(str(SCREEN), stack.observer, "1") as process,
    ):
        await console.take_seat()
        driving = asyncio.ensure_future(turn(console))
        try:
            async for line in lines(process):
                certificate = line.get("certificate", certificate)
                if "band" in line:
                    shown.append(line)
                elif "gap" in line:
                    judged.append(line)
                if len({each["event"] for each in shown}) >= 40:
                    break
        finally:
            driving.cancel()
    assert [drawn_in(each) for each in shown] == [each["event"] for each in shown]
    assert all(each["shown"] == (abs(each["gap"]) <= 1) for each in judged)
    assert [each["event"] for each in shown] == [each["event"] for each in judged if each["shown"]][: len(shown)]
    assert (shown[0]["width"], shown[0]["height"]) == (640, 480)
    key = load_pem_x509_certificate(certificate.encode()).public_key()
    assert isinstance(key, rsa.RSAPublicKey)  # what GStreamer makes unless it is told otherwise


async def test_the_example_prints_a_line_for_each_picture_and_ends_its_session_when_it_is_asked_to(
    stack: Stack,
) -> None:
    async with (
        asyncio.timeout(50),
        running(str(EXAMPLE), stack.observer, "--screen", "fakesink") as process,
        Console(stack.operator, video=0, audio=False) as console,
    ):
        assert process.stdout is not None
        for _ in range(10):
            assert LINE.fullmatch((await process.stdout.readline()).decode().rstrip())
        process.terminate()
        await process.communicate()
        assert process.returncode == 0
        await until_alone(console)


async def test_the_example_says_in_words_that_a_link_is_no_good(stack: Stack) -> None:
    async with asyncio.timeout(50), running(str(EXAMPLE), f"{stack.console}/#token=none") as process:
        _, error = await process.communicate()
    assert process.returncode == 1
    # Libraries may write above it what they could not do, such as UPnP on an address that is taken.
    (said,) = [line for line in error.decode().splitlines() if line.startswith("401: ")]
    assert "unauthorized" in said


def test_the_packages_that_the_example_names_are_those_that_the_tests_install() -> None:
    named = set(re.findall(r"\b(?:python3-gi|gir1\.2-gst[\w.-]+|gstreamer1\.0-\w[\w-]*)", EXAMPLE.read_text()))
    installed = (ROOT / "Makefile").read_text()
    assert len(named) == 6
    assert all(each in installed for each in named)
