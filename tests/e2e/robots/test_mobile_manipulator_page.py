"""The default robot, as `make run` shows it: MuJoCo's pictures and sound, and the 3D scene."""

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import open_console
from tests.e2e.conftest import RobotKeeper
from tests.support.stack import Stack

pytestmark = pytest.mark.browser

# How unlike the pixels of a canvas are: a blank picture has a spread of 0.
SPREAD = """(name) => {
  const canvas = document.querySelector(`canvas[data-stream="${name}"]`);
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let low = 255, high = 0;
  for (let at = 1; at < pixels.length; at += 4) { low = Math.min(low, pixels[at]); high = Math.max(high, pixels[at]); }
  return high - low;
}"""


@pytest_asyncio.fixture(loop_scope="session")
async def manipulator(robot_keeper: RobotKeeper) -> Stack:
    return await robot_keeper.stack("mobile-manipulator")


async def test_the_default_robot_is_seen_heard_and_driven(manipulator: Stack, chromium: Browser) -> None:
    async with open_console(chromium, manipulator.operator) as console:
        await console.until_live()
        for camera in ("overview", "wrist"):
            assert await console.page.evaluate(SPREAD, camera) > 80, camera
        await console.until("s.streams.microphone.rendered > 10")
        async with console.driving():
            await console.until("s.event > 40", 60)
        streams = (await console.stats())["streams"]
        assert {name: stream["violations"] for name, stream in streams.items()} == dict.fromkeys(streams, 0)


async def test_the_3d_scene_is_one_of_the_views_and_shows_the_robot(manipulator: Stack, chromium: Browser) -> None:
    async with open_console(chromium, manipulator.operator) as console:
        await console.until_live()
        await console.open_full_scene()
        frame = console.page.frame_locator("iframe")
        await frame.locator("canvas").first.wait_for(timeout=60_000)
        assert await console.page.evaluate("document.querySelector('iframe').src.includes('/scene/')")
