"""A robot that encodes beside its cameras, in a real browser: on a good network and on 512 kbit/s."""

from pathlib import Path

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import open_console
from lockstep.bench.harness.stack import running_bridge, running_console
from lockstep.emulator import NetworkProcess
from tests.support.stack import running_stack

pytestmark = pytest.mark.browser


async def test_the_page_shows_what_the_robot_encoded_and_nothing_beyond_the_tolerance(
    chromium: Browser, tmp_path: Path
) -> None:
    async with (
        running_stack(tmp_path, extra=("--encode", "h264")) as stack,
        open_console(chromium, stack.operator) as console,
    ):
        await console.until_live()
        async with console.driving():
            start = (await console.stats())["event"]
            await console.until(f"s.event > {start + 50} && s.streams.overview.rendered > 60", 60)
        streams = (await console.stats())["streams"]
        assert streams["overview"]["codec"] == "H264"
        assert [name for name, stream in streams.items() if stream["violations"]] == []


async def test_a_robot_is_driven_by_its_pictures_behind_512_kbit_s(chromium: Browser, tmp_path: Path) -> None:
    async with (
        running_bridge("planar", options=("--encode", "h264")) as bridge,
        NetworkProcess("robot-512k", robot=("127.0.0.1", bridge.port)) as network,
        running_console(network.robot_address, environment={"LOCKSTEP_STATE_DIR": str(tmp_path / "state")}) as (
            _,
            links,
        ),
        open_console(chromium, links["operator"]) as console,
    ):
        await console.until_live()
        async with console.driving():
            start = (await console.stats())["event"]
            await console.until(f"s.event > {start + 60} && s.streams.overview.rendered > 100", 60)
        streams = (await console.stats())["streams"]
        assert [name for name, stream in streams.items() if stream["violations"]] == []
        sent = network.statistics().paths["robot_media"]["to_operator"]
        assert sent.bytes / sent.passed < 10_000  # no raw picture among them
