"""What both eyes see in an emulated headset: the gate's pictures and none else, veils, a stereo pair, AR."""

import os
import re
from collections.abc import AsyncIterator, Sequence
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from lockstep.bench.browsers.headset_page import Headset, open_headset
from tests.support.stack import Stack, running_stack

# A headset that stands still for 0.3 s stops the robot; this machine draws its view for longer beside other work.
pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.timeout(240)]

# Places in the window: the large picture's middle as the left and as the right eye sees it, and above all panels.
LEFT_EYE, RIGHT_EYE, ABOVE = (0.25, 0.43), (0.75, 0.43), (0.25, 0.03)
NEAR = 40  # of 255: H.264 and the filter of a texture that is seen smaller change a colour by less
# The mean of each colour in the middle third of a canvas of the page.
MEAN = """(stream) => {
  const canvas = document.querySelector(`canvas[data-stream="${stream}"]`);
  const [width, height] = [canvas.width, canvas.height];
  const at = [width * 0.45, height * 0.4, width * 0.1, height * 0.1].map(Math.floor);
  const { data } = canvas.getContext("2d").getImageData(...at);
  const sums = [0, 0, 0];
  for (let pixel = 0; pixel < data.length; pixel++) if (pixel % 4 < 3) sums[pixel % 4] += data[pixel];
  return sums.map((sum) => sum / (data.length / 4));
}"""


async def _seen(headset: Headset, place: tuple[float, float]) -> list[float]:
    found: list[float] = await headset.page.evaluate("([x, y]) => testHeadset.area(x, y)", list(place))
    return found


def _far(one: Sequence[float], other: Sequence[float]) -> float:
    return max(abs(left - right) for left, right in zip(one[:3], other[:3], strict=True))


async def _picture(headset: Headset, name: str) -> None:
    """Both eyes, for a person who wants to look at them."""
    if folder := os.environ.get("LOCKSTEP_TEST_PICTURES"):
        await headset.page.screenshot(path=Path(folder) / f"{name}.png")


@pytest_asyncio.fixture(loop_scope="session")
async def posed(half_rate: None, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Stack]:
    async with running_stack(tmp_path_factory.mktemp("posed"), robot="tests.e2e.posed_arm:PosedArm") as stack:
        yield stack


async def test_a_picture_that_the_page_veils_is_veiled_for_both_eyes_and_nothing_else_is_drawn(
    own_stack: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, own_stack.operator) as headset:
        console = headset.console
        await headset.enter()
        await console.until("s.headset.panels.every((panel) => panel.veil === null)")
        shown = await headset.page.evaluate(MEAN, "overview")
        for eye in (LEFT_EYE, RIGHT_EYE):
            assert _far(await _seen(headset, eye), shown) < NEAR
        await _picture(headset, "headset-vr")
        with own_stack.frozen_console():
            await console.until("s.headset.panels.every((panel) => panel.veil !== null)")
            await _picture(headset, "headset-veiled")
            veiled = [await _seen(headset, eye) for eye in (LEFT_EYE, RIGHT_EYE)]
            veils = [panel["veil"] for panel in (await console.stats())["headset"]["panels"]]
        words = "No picture", "Not connected", "Robot unreachable"
        assert all(veil.startswith(words) for veil in veils), veils
        # The room's floor is bluish; what the veil says stands on dark red.
        assert shown[2] > shown[0]
        assert all(red > blue for red, _, blue, _ in veiled), veiled


async def test_no_frame_of_a_session_shows_a_picture_out_of_tolerance_without_its_veil(
    stack: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        console = headset.console
        await console.page.evaluate("lockstep.configure({ tolerance: { video: 1 } })")
        await headset.enter()
        await headset.page.evaluate("testHeadset.watch('overview')")
        await headset.drive()
        await headset.drive_until(
            "testHeadset.watched.length > 30 && s.event > 40 && testHeadset.watched.some(({ gap }) => gap > 1)"
        )
        watched = await headset.page.evaluate("testHeadset.watched")
        stale = [each for each in watched if each["gap"] > 1]
        assert stale
        assert [each for each in stale if each["veil"] is None] == []
        assert (await console.stats())["streams"]["overview"]["violations"] == 0


async def test_a_pair_of_cameras_is_seen_by_an_eye_each(posed: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, posed.operator) as headset:
        console = headset.console
        await headset.enter()
        await console.until("s.headset.panels.length === 1 && s.headset.panels[0].veil === null")
        (panel,) = (await console.stats())["headset"]["panels"]
        assert (panel["left"], panel["right"]) == ("eyes.left", "eyes.right")
        left, right = [await headset.page.evaluate(MEAN, f"eyes.{side}") for side in ("left", "right")]
        assert _far(left, right) > NEAR
        for eye, own, other in ((LEFT_EYE, left, right), (RIGHT_EYE, right, left)):
            seen = await _seen(headset, eye)
            assert _far(seen, own) < _far(seen, other)
        await _picture(headset, "headset-stereo")


async def test_in_ar_the_room_is_seen_beside_the_panels_and_the_view_can_be_recentred(
    stack: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        await headset.enter("AR")
        assert (await headset.console.stats())["headset"]["mode"] == "immersive-ar"
        assert (await _seen(headset, ABOVE))[3] == 0
        assert (await _seen(headset, LEFT_EYE))[3] == 255
        await _picture(headset, "headset-ar")
        await headset.look(2.5)
        assert (await _seen(headset, LEFT_EYE))[3] == 0  # the panels stay where they are
        await headset.press("right", "thumbstick")
        await headset.press("right", "thumbstick", 0)
        assert (await _seen(headset, LEFT_EYE))[3] == 255


async def test_the_view_says_event_gap_delay_and_force_and_where_the_time_goes(stack: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, stack.operator) as headset:
        await headset.enter()
        await headset.drive()
        # The network's part is the remainder by event: it follows some driven events after the others.
        await headset.drive_until(
            "['Capture', 'Encode', 'Gate', 'Headset'].every((name) => name in s.headset.way)"
            " && ('Network' in s.headset.way || 'Network, decode' in s.headset.way)"
        )
        statistics = (await headset.console.stats())["headset"]
        assert statistics["way"]["Headset"] > 0
        assert statistics["frame_ms"] > 0
        await headset.console.until("s.headset.figures.Delay !== '– ms'")
        figures = (await headset.console.stats())["headset"]["figures"]
        assert int(figures["Event"].replace("\u202f", "")) > 1  # a narrow space between thousands
        assert re.fullmatch(r"\d+ of \d+", figures["Gap"])
        assert re.fullmatch(r"[\d.]+ ms", figures["Delay"])
        assert re.fullmatch(r"\d+\.\d N", figures["Force"])
        await _picture(headset, "headset-driving")
