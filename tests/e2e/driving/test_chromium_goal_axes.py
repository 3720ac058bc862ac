"""Goal axes on the page: keys and pads jog them, sliders drag them, and they stay where they are let go."""

import itertools
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, Page, expect

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import LEFT_X, RB, START
from tests.e2e.accessibility import findings
from tests.e2e.driving.goal_arm import AXES, ELBOW, LAYERS, LIFT, PAN, ROLL
from tests.support.stack import Stack, running_stack

pytestmark = [pytest.mark.browser, pytest.mark.timeout(240)]

ARM_TRIES = 3
Y = 3  # W3C standard mapping: the next layer
REACH_SHARE = 0.8  # that a goal of the page uses


@pytest_asyncio.fixture(loop_scope="session")
async def arm(half_rate: None, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Stack]:
    directory = tmp_path_factory.mktemp("arm")
    async with running_stack(directory, robot="tests.e2e.driving.goal_arm:GoalArm") as stack:
        yield stack


def slider(page: Page, label: str) -> Locator:
    return page.get_by_role("slider", name=label, exact=True)


async def _arm(console: ConsolePage) -> None:
    """Press Enter; again where the page had not yet seen that everything was let go."""
    for _ in range(ARM_TRIES - 1):
        await console.page.keyboard.press("Enter")
        with suppress(AssertionError):
            await console.until("s.armed", 3)
            return
    await console.page.keyboard.press("Enter")
    await console.until("s.armed")


async def _drag(page: Page, label: str, share: float) -> None:
    """Take the slider where it is, and drag it by a share of its range; it is still held afterwards."""
    box = await slider(page, label).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x + share * box["width"], y, steps=8)


async def _comes_to_rest(console: ConsolePage, axis: str) -> float:
    """Return the goal that the robot applies, as soon as it stays."""
    await console.until(f"s.commanded['{axis}'] === null && s.gate.state !== 'in_flight'")
    settled = """(axis) => new Promise((resolve) => {
      let last = null, since = performance.now();
      const look = () => {
        const goal = lockstep.stats().goals[axis];
        if (goal !== last) [last, since] = [goal, performance.now()];
        if (performance.now() - since > 500) resolve(goal); else setTimeout(look, 20);
      };
      look();
    })"""
    goal: float = await console.page.evaluate(settled, axis)
    return goal


async def _executed(stack: Stack, axis: int) -> list[float | None]:
    return [record["values"][axis] for record in await stack.events("executed")]


def _begins(values: Sequence[float | None]) -> list[float]:
    """The first goal of each time that the axis was driven."""
    pairs = itertools.pairwise([None, *values])
    return [value for before, value in pairs if before is None and value is not None]


async def test_keys_move_a_goal_axis_from_where_it_is_and_it_stays_when_they_are_let_go(
    arm: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, arm.operator, pad=False) as console:
        page = console.page
        await console.until_live()
        start = (await console.stats())["goals"]["lift"]
        await console.until(f"s.axes.lift < {start}")  # it hangs below its goal
        await _arm(console)
        for _ in range(3):
            await page.keyboard.down("Space")
            await page.keyboard.down("KeyW")
            begun = (await console.stats())["goals"]["lift"]
            await console.until(f"s.goals.lift > {begun + 0.1}")
            await page.keyboard.up("KeyW")
            await _comes_to_rest(console, "lift")
            await page.keyboard.up("Space")
            rested = await _comes_to_rest(console, "lift")
        assert rested > start + 0.3
        values = await _executed(arm, 1)
        begins = _begins(values)
        assert len(begins) == 3
        # The key moves the goal from there on, also while the gate still holds the first command back, by no more than
        # its lead (web/src/drive/goals/jog.ts): three quarters of the usable reach, which is 0.8 of the reach.
        lead = 0.75 * 0.8 * LIFT.reach
        assert start - 1e-9 <= begins[0] <= start + lead, "driving begins where the robot is told to be"
        assert begins == sorted(begins)
        goals = [value for value in values if value is not None]
        steps = [abs(after - before) for before, after in itertools.pairwise(goals)]
        assert max(steps) < REACH_SHARE * AXES[1].reach, "no goal jumps"
        assert not await arm.events("refused")
        for axis in (0, 2, 3, 4, 5):
            assert set(await _executed(arm, axis)) == {None}, "the other axes were told to stay"


async def test_a_slider_is_held_to_run_follows_the_hand_and_is_left_where_it_is(arm: Stack, chromium: Browser) -> None:
    async with open_console(chromium, arm.operator, pad=False) as console:
        page = console.page
        await console.until_live()
        start = (await console.stats())["goals"]["pan"]
        await _drag(page, "Shoulder pan", 0.3)
        await page.mouse.up()
        assert not _begins(await _executed(arm, 0)), "a page that is not armed moves nothing"
        await _arm(console)
        await _drag(page, "Shoulder pan", 0.1)
        wanted = start + 0.1 * (PAN.maximum - PAN.minimum)
        await console.until(f"s.driving && Math.abs(s.goals.pan - {wanted}) < 0.02")
        await expect(slider(page, "Shoulder pan")).to_have_attribute("aria-disabled", "false")
        await page.mouse.up()
        await console.until("!s.driving && s.armed")
        rested = await _comes_to_rest(console, "pan")
        assert rested == pytest.approx(wanted, abs=0.05)
        # Taken again anywhere, it moves nothing until it is dragged; dragged far, it is led within reach.
        await _drag(page, "Shoulder pan", 0.0)
        await console.until("s.driving")
        assert await _comes_from_here(console, "pan") == pytest.approx(rested, abs=1e-6)
        await page.mouse.up()
        await _drag(page, "Shoulder pan", -0.4)
        await console.until(f"s.goals.pan < {rested - 0.3}")
        stats = await console.stats()
        assert abs(stats["commanded"]["pan"] - stats["axes"]["pan"]) <= PAN.reach
        # STOP while it is held: nothing of the drag outlives it.
        await page.keyboard.press("Escape")
        await console.until("!s.armed && s.stop.stopped && s.commanded.pan === null")
        await page.mouse.up()
        await console.reset()
        await _comes_to_rest(console, "pan")
        assert not [each for each in await arm.events("refused") if each["reason"] == "jump"]


async def _comes_from_here(console: ConsolePage, axis: str) -> float:
    await console.until(f"s.commanded['{axis}'] !== null")
    commanded: float = (await console.stats())["commanded"][axis]
    return commanded


async def test_arrow_keys_push_the_slider_that_has_the_focus(arm: Stack, chromium: Browser) -> None:
    async with open_console(chromium, arm.operator, pad=False) as console:
        page = console.page
        await console.until_live()
        start = (await console.stats())["goals"]
        await slider(page, "Gripper").focus()
        await _arm(console)
        await page.keyboard.down("ArrowUp")
        await page.keyboard.down("Space")
        await console.until(f"s.goals.jaw > {start['jaw'] + 0.01}")
        await page.keyboard.up("Space")
        await page.keyboard.up("ArrowUp")
        await _comes_to_rest(console, "jaw")
        goals = (await console.stats())["goals"]
        assert goals["elbow"] == start["elbow"], "the layer's arrow keys are the slider's now"


async def test_a_pad_reaches_all_six_joints_by_two_layers_and_one_that_turns_on_goes_round(
    arm: Stack, chromium: Browser
) -> None:
    assert {binding.axis for layer in LAYERS for binding in layer.bindings} == {axis.name for axis in AXES}
    async with open_console(chromium, arm.operator) as console:
        await console.until_live()
        await console.arm()
        await console.pad.press(Y)
        await console.pad.press(Y, False)
        await console.until("s.layer === 'wrist'")
        await console.pad.press(RB)
        await console.pad.tilt(LEFT_X, 1.0)
        await console.until(
            "s.goals.roll > 3.3 || s.goals.roll < -2.5", 60
        )  # past the border, whose other side is -3.1
        await console.pad.tilt(LEFT_X, 0.0)
        await _comes_to_rest(console, "roll")
        await console.pad.press(RB, False)
        await console.pad.press(START)
        await console.pad.press(START, False)
        await console.until("!s.armed")
        values = [value for value in await _executed(arm, 4) if value is not None]
        assert max(values) - min(values) < 2 * (ROLL.wrap or 0)
        assert not await arm.events("refused")


async def test_a_goal_out_of_reach_is_refused_the_page_says_what_to_do_and_a_reset_begins_where_the_robot_is(
    arm: Stack, chromium: Browser
) -> None:
    async with open_console(chromium, arm.operator, pad=False) as console:
        page = console.page
        await console.until_live()
        await page.get_by_role("button", name="Hold elbow").click()
        await console.until(f"s.goals.elbow - s.axes.elbow > {ELBOW.reach}")
        await _arm(console)
        await page.keyboard.down("Space")
        await page.keyboard.down("ArrowUp")
        strip = page.get_by_label("Limits of the robot")
        await expect(strip).to_contain_text("Elbow is too far from its goal")
        await expect(page.locator('[data-axis="elbow"]')).to_have_attribute("data-state", "refused")
        await page.keyboard.up("ArrowUp")
        await page.keyboard.up("Space")
        await page.keyboard.press("Escape")
        await console.until("s.stop.stopped")
        await console.reset()
        await console.until("Math.abs(s.goals.elbow - s.axes.elbow) < 1e-9")
        await expect(strip).not_to_contain_text("Elbow is too far", timeout=10_000)
        refused = len(await arm.events("refused"))
        await _arm(console)
        await page.keyboard.down("Space")
        await page.keyboard.down("ArrowUp")
        await console.until(f"s.goals.elbow > {(await console.stats())['axes']['elbow'] + 0.1}")
        await page.keyboard.up("ArrowUp")
        await page.keyboard.up("Space")
        assert len(await arm.events("refused")) == refused


@pytest.mark.parametrize("lost", ["blur", "hidden"])
async def test_a_page_that_is_left_lets_go_of_its_goals_and_begins_anew(
    lost: str, arm: Stack, chromium: Browser
) -> None:
    leave = {
        "blur": "() => window.dispatchEvent(new Event('blur'))",
        "hidden": """() => {
          Object.defineProperty(document, 'hidden', { configurable: true, get: () => true });
          document.dispatchEvent(new Event('visibilitychange'));
        }""",
    }[lost]
    async with open_console(chromium, arm.operator, pad=False) as console:
        page = console.page
        await console.until_live()
        await _arm(console)
        await _drag(page, "Elbow", -0.1)
        await console.until("s.commanded.elbow !== null")
        await page.evaluate(leave)
        await console.until("!s.armed && s.commanded.elbow === null")
        await _comes_to_rest(console, "elbow")
        await page.mouse.up()
        begins = _begins(await _executed(arm, 2))
        assert len(begins) == 1


async def test_the_axes_are_accessible_and_fit_a_phone(arm: Stack, chromium: Browser) -> None:
    async with open_console(chromium, arm.operator, width=390, height=844, touch=True, pad=False) as console:
        page = console.page
        await console.until_live()
        sliders = page.get_by_role("slider")
        await expect(sliders).to_have_count(4)
        for each in await sliders.all():
            box = await each.bounding_box()
            assert box is not None
            assert box["height"] >= 34
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 390
        await expect(slider(page, "Elbow")).to_have_attribute("aria-valuetext", "63.0°, goal 63.0°")
        await expect(page.get_by_role("button", name="STOP")).to_be_in_viewport()
        assert await findings(page) == []
