"""Controllers and tracked hands of an emulated headset drive a tool's pose through the clutch."""

import itertools
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from tests.e2e.headset import Headset, open_headset
from tests.e2e.posed_arm import PosedArm
from tests.support.stack import Stack, running_stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]

NAMES = [axis.name for axis in PosedArm().describe().axes]
GRIP = [0.2, 1.3, -0.4]


@pytest_asyncio.fixture(loop_scope="session")
async def posed(half_rate: None, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Stack]:
    async with running_stack(tmp_path_factory.mktemp("posed"), robot="tests.e2e.posed_arm:PosedArm") as stack:
        yield stack


def _moved(position: list[float], by: tuple[float, float, float]) -> list[float]:
    return [start + step for start, step in zip(position, by, strict=True)]


async def _goals(headset: Headset) -> dict[str, float]:
    goals: dict[str, float] = (await headset.console.stats())["goals"]
    return goals


async def _engage(headset: Headset) -> None:
    await headset.drive_until("s.driving && s.commanded['tool.x'] !== null")


async def test_a_controller_leads_the_tool_from_where_it_is_and_letting_go_anywhere_moves_nothing(
    posed: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, posed.operator) as headset:
        console = headset.console
        await headset.enter()
        start = await _goals(headset)
        for grip in (GRIP, [-0.3, 0.9, -0.2]):  # the second time from elsewhere
            await headset.squeeze(value=0)
            await headset.place("right", grip)
            before = await _goals(headset)
            await _engage(headset)
            await headset.place("right", _moved(grip, (0, 0.05, -0.1)))  # up, and away from the operator
            await console.until(f"Math.abs(s.goals['tool.x'] - {before['tool.x'] + 0.1}) < 0.01")
            await console.until(f"Math.abs(s.goals['tool.z'] - {before['tool.z'] + 0.05}) < 0.01")
            await headset.place("right", _moved(grip, (0, 0.05, -0.1)), left=0.3)
            await console.until(f"Math.abs(s.goals['tool.rz'] - {before['tool.rz'] + 0.3}) < 0.02")
            await headset.squeeze(value=0)
            await console.until("!s.armed && s.commanded['tool.x'] === null")
        end = await _goals(headset)
        # The grip goes round the point that a test turns the controller about: some centimetres.
        assert abs(end["tool.x"] - start["tool.x"] - 0.2) < 0.08
        assert abs(end["tool.y"] - start["tool.y"]) < 0.08
        # No goal is further from the one before than a hand goes at once, and each drive begins where the last ended.
        values = [record["values"] for record in await posed.events("executed")]
        for axis in NAMES[3:6]:
            index = NAMES.index(axis)
            given = [value[index] for value in values if value[index] is not None]
            assert max(abs(later - sooner) for sooner, later in itertools.pairwise(given)) < 0.12, (axis, given)
        assert not [record for record in await posed.events("refused") if record.get("reason") in ("jump", "conflict")]


async def test_sticks_drive_the_base_and_the_trigger_the_gripper_while_a_hand_leads_the_tool(
    posed: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, posed.operator) as headset:
        console = headset.console
        await headset.enter()
        await _engage(headset)
        # The stick that is bound to the joint which the pose stands for moves nothing.
        await headset.tilt("right", 0, -1)
        await headset.tilt("left", 0, -1)
        await headset.press("right", "trigger")
        await headset.drive_until(
            "s.axes['base.vx'] > 0.1 && s.goals.jaw > 0.02 && s.commanded['tool.x'] !== null"
            " && s.commanded.pan === null"
        )
        await headset.press("right", "trigger", 0)
        await headset.press("left", "trigger")
        await headset.drive_until("s.goals.jaw < 0.01")
        await headset.squeeze(value=0)
        await console.until("!s.armed && s.at_rest === true")


async def test_the_scale_and_what_is_held_still_are_chosen_on_the_page(posed: Stack, chromium: Browser) -> None:
    async with open_headset(chromium, posed.operator) as headset:
        console = headset.console
        hands = headset.page.get_by_role("region", name="Hands in the headset")
        await hands.get_by_label("Tool's way by the hand's").select_option("0.5")
        await hands.get_by_label("The camera looks").select_option("180")
        await hands.get_by_label("Hold still: up and down").press("Space")
        await headset.enter()
        await headset.place("right", GRIP)
        before = await _goals(headset)
        await _engage(headset)
        await headset.place("right", _moved(GRIP, (0, 0.2, -0.2)))
        await console.until(f"Math.abs(s.goals['tool.x'] - {before['tool.x'] - 0.1}) < 0.01")
        assert abs((await _goals(headset))["tool.z"] - before["tool.z"]) < 1e-6


async def test_a_tracked_hand_that_closes_leads_the_tool_and_lets_go_when_it_opens(
    posed: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, posed.operator) as headset:
        console = headset.console
        await headset.enter()
        await headset.do("void (h.device.primaryInputMode = 'hand')")
        await console.until("s.headset.hands.length === 2 && s.headset.hands.every((hand) => hand.tracked)")
        await headset.place("right", GRIP)
        before = await _goals(headset)
        for _ in range(5):
            await headset.do("void (h.device.hands.right.poseId = 'default')")
            await headset.do("h.seen()")
            await headset.do("void (h.device.hands.right.poseId = 'point')")  # all fingers closed but the index finger
            await console.until("!s.armed || s.commanded['tool.x'] !== null")
            if await headset.holds("s.commanded['tool.x'] !== null"):
                break
        await headset.place("right", _moved(GRIP, (0.1, 0, 0)))
        await console.until(f"Math.abs(s.goals['tool.y'] - {before['tool.y'] - 0.1}) < 0.01")
        await headset.do("void (h.device.hands.right.poseId = 'default')")
        await console.until("!s.armed && s.commanded['tool.y'] === null")
