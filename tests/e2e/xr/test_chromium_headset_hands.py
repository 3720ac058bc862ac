"""Controllers and tracked hands of an emulated headset drive a tool's pose through the clutch."""

import itertools
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser

from lockstep.bench.browsers.headset_page import TRIES, Headset, open_headset
from tests.e2e.conftest import RobotKeeper
from tests.e2e.posed_arm import PosedArm
from tests.support.stack import Stack, running_stack

# A headset that stands still for 0.3 s stops the robot; this machine draws its view for longer beside other work.
pytestmark = [pytest.mark.browser, pytest.mark.alone, pytest.mark.timeout(240)]

NAMES = [axis.name for axis in PosedArm().describe().axes]
GRIP = [0.2, 1.3, -0.4]


@pytest_asyncio.fixture(loop_scope="session")
async def posed(robot_keeper: RobotKeeper) -> Stack:
    return await robot_keeper.stack("tests.e2e.posed_arm:PosedArm")


def _moved(position: list[float], by: tuple[float, float, float]) -> list[float]:
    return [start + step for start, step in zip(position, by, strict=True)]


async def _goals(headset: Headset) -> dict[str, float]:
    goals: dict[str, float] = (await headset.console.stats())["goals"]
    return goals


async def _engage(headset: Headset) -> None:
    await headset.drive_until("s.driving && s.commanded['tool.x'] !== null")


async def _lead(headset: Headset, grip: list[float], to: list[float], reached: str, turn: float = 0) -> None:
    """Take the tool with the hand at `grip` and lead it until `reached`, over the goals at the take-over, `b`.

    Again, from where the robot is then, if a busy machine ended it.
    """
    for _ in range(TRIES):
        await headset.squeeze(value=0)
        await headset.place("right", grip)
        await headset.page.evaluate("void (window.before = lockstep.stats().goals)")
        await _engage(headset)
        await headset.place("right", to, left=turn)
        condition = f"((b) => {reached})(window.before)"
        await headset.console.until(f"!s.armed || {condition}")
        if await headset.holds(condition):
            return
    raise AssertionError(f"the hand does not lead the tool: {await headset.console.stats()}")


def _near(axis: str, by: float) -> str:
    return f"Math.abs(s.goals['tool.{axis}'] - b['tool.{axis}'] - {by}) < 0.02"


async def test_a_controller_leads_the_tool_from_where_it_is_and_letting_go_anywhere_moves_nothing(
    posed: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, posed.operator) as headset:
        console = headset.console
        await headset.enter()
        for grip in (GRIP, [-0.3, 0.9, -0.2]):  # the second time from elsewhere
            to = _moved(grip, (0, 0.05, -0.1))  # up, and away from the operator
            await _lead(headset, grip, to, f"{_near('x', 0.1)} && {_near('y', 0)} && {_near('z', 0.05)}")
            await headset.squeeze(value=0)
            await console.until("!s.armed && s.commanded['tool.x'] === null")
        rested = await _goals(headset)
        await headset.place("right", [0.3, 1.5, -0.5], left=1.0)  # nobody holds it
        await _engage(headset)
        await headset.squeeze(value=0)
        await console.until("!s.armed && s.at_rest === true")
        assert (await _goals(headset)) == pytest.approx(rested, abs=1e-3)
        # The tool turns as the hand does: here about the point of the aim, a hand's length from the grip.
        await _lead(headset, GRIP, GRIP, _near("rz", 0.3), turn=0.3)
        await headset.squeeze(value=0)
        # No goal is further from the one before than a hand goes at once, and each drive begins where the last ended.
        values = [record["values"] for record in await posed.events("executed")]
        for axis in NAMES[3:6]:
            index = NAMES.index(axis)
            given = [value[index] for value in values if value[index] is not None]
            assert max(abs(later - sooner) for sooner, later in itertools.pairwise(given)) < 0.12, (axis, given)
        assert not [record for record in await posed.events("refused") if record.get("reason") in ("jump", "conflict")]


async def test_a_pose_in_the_frame_of_a_camera_follows_the_hand_as_seen_in_that_picture(
    half_rate: None, tmp_path: Path, chromium: Browser
) -> None:
    async with (
        running_stack(tmp_path, robot="tests.e2e.posed_arm:CameraPosedArm") as stack,
        open_headset(chromium, stack.operator) as headset,
    ):
        await headset.enter()
        to = _moved(GRIP, (0.08, 0.05, -0.1))  # to the right, up, and into the picture
        await _lead(headset, GRIP, to, f"{_near('x', 0.08)} && {_near('y', -0.05)} && {_near('z', 0.1)}")


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
        hands = headset.page.get_by_role("region", name="Hands in the headset")
        await hands.get_by_label("Tool motion per hand motion").select_option("0.5")
        await hands.get_by_label("The camera looks").select_option("180")
        await hands.get_by_label("Hold still: up and down").press("Space")
        await headset.enter()
        await _lead(headset, GRIP, _moved(GRIP, (0, 0.2, -0.2)), f"{_near('x', -0.1)} && {_near('z', 0)}")


async def test_a_tracked_hand_that_closes_leads_the_tool_and_lets_go_when_it_opens(
    posed: Stack, chromium: Browser
) -> None:
    async with open_headset(chromium, posed.operator) as headset:
        console = headset.console
        await headset.enter()
        await headset.do("void (h.device.primaryInputMode = 'hand')")
        await console.until("s.headset.hands.length === 2 && s.headset.hands.every((hand) => hand.tracked)")
        for _ in range(TRIES):  # a busy machine may end it
            await headset.do("void (h.device.hands.right.poseId = 'default')")
            await headset.place("right", GRIP)
            before = await _goals(headset)
            await headset.do("void (h.device.hands.right.poseId = 'point')")  # all closed but the index finger
            await console.until("!s.armed || s.commanded['tool.x'] !== null")
            await headset.place("right", _moved(GRIP, (0.1, 0, 0)))
            reached = f"Math.abs(s.goals['tool.y'] - {before['tool.y'] - 0.1}) < 0.01"
            await console.until(f"!s.armed || {reached}")
            if await headset.holds(reached):
                break
        else:
            raise AssertionError("the hand does not lead the tool")
        await headset.do("void (h.device.hands.right.poseId = 'default')")
        await console.until("!s.armed && s.commanded['tool.y'] === null")
        await console.until("s.headset.text.includes('Squeeze')")
