"""One and the same test over every robot: what it knows of each is what the robot says about itself."""

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Browser

from lockstep.bench.browsers.console_page import ConsolePage, open_console
from lockstep.bench.browsers.pad import RB, STOP_BUTTON
from tests.e2e.so101 import SO101, needs_so101
from tests.support.c_robot import running_c_robot
from tests.support.ros2 import EXAMPLES, have_ros, ros_python, running_ros_robot
from tests.support.stack import Stack, running_console, running_stack

pytestmark = [pytest.mark.browser, pytest.mark.full_rate, pytest.mark.timeout(240)]

Starting = Callable[[Path], AbstractAsyncContextManager[Stack]]

STICKS = {"left_x": 0, "left_y": 1, "right_x": 2, "right_y": 3}
# What the pad calls negative and positive: buttons of the W3C standard mapping.
BUTTONS = {"dpad_x": (14, 15), "dpad_y": (12, 13), "triggers": (6, 7)}
MOVED = 0.1  # of the axis' limit
TRIES = 6  # where a busy machine holds the robot up


def registered(name: str) -> Starting:
    return lambda directory: running_stack(directory, robot=name)


def own_model(directory: Path) -> AbstractAsyncContextManager[Stack]:
    return running_stack(directory, extra=("--mjcf", str(EXAMPLES.parent / "mjcf" / "desk_arm.xml")))


def so101(directory: Path) -> AbstractAsyncContextManager[Stack]:
    return running_stack(directory, robot="so101", settings=SO101)


def ros(example: str) -> Starting:
    @asynccontextmanager
    async def start(directory: Path) -> AsyncIterator[Stack]:
        async with running_ros_robot(directory) as robot:
            extra = ("--ros2", str(EXAMPLES / example), "--robot-python", ros_python())
            async with running_stack(directory, extra=extra, settings=robot.environment) as stack:
                yield stack

    return start


@asynccontextmanager
async def in_c(directory: Path) -> AsyncIterator[Stack]:
    async with (
        running_c_robot(directory) as robot,
        running_console(directory, robot.url, robot.event_log) as stack,
    ):
        yield stack


needs_ros = pytest.mark.skipif(not have_ros(), reason="there are no wheels of ROS 2 for this machine")
ROBOTS = [
    pytest.param(registered("planar"), id="planar"),
    pytest.param(registered("mobile-manipulator"), id="mobile-manipulator"),
    pytest.param(registered("micromanipulator"), id="micromanipulator"),
    pytest.param(own_model, id="mjcf"),
    pytest.param(registered("tests.e2e.driving.goal_arm:GoalArm"), id="goal-axes"),
    pytest.param(so101, id="so101", marks=needs_so101),
    pytest.param(ros("base.yaml"), id="ros2-base", marks=needs_ros),
    pytest.param(ros("arm.yaml"), id="ros2-arm", marks=needs_ros),
    pytest.param(in_c, id="c"),
]


@pytest.mark.parametrize("start", ROBOTS)
async def test_the_same_page_drives_stops_and_shows_any_robot(
    start: Starting, tmp_path: Path, chromium: Browser
) -> None:
    async with start(tmp_path) as stack:
        async with open_console(chromium, stack.operator) as console:
            await console.until_live()
            robot = await console.page.evaluate("window.lockstep.robot()")
            driven: set[str] = set()
            for layer in robot["layers"]:
                await _choose(console, robot, layer)
                await _arm(console)
                for binding in layer["bindings"]:
                    await _drive(console, robot, binding, driven)
            await _saw_every_camera(console, robot)
            await _stop_and_reset(console)
        await _no_stamp_is_newer_than_the_truth(stack, robot)
        await _nothing_executed_twice(stack)


async def _choose(console: ConsolePage, robot: Any, layer: Any) -> None:
    if len(robot["layers"]) > 1:
        group = console.page.get_by_role("group", name="Control layer")
        await group.get_by_role("button", name=layer["label"], exact=True).click()
    await console.until(f"s.layer === '{layer['name']}' && s.at_rest === true")


async def _arm(console: ConsolePage) -> None:
    if not (await console.stats())["armed"]:
        await console.arm()


async def _drive(console: ConsolePage, robot: Any, binding: Any, driven: set[str]) -> None:
    """Hold the deadman and this one input until the axis is seen to move the way it was told to."""
    axis = next(axis for axis in robot["axes"] if axis["name"] == binding["axis"])
    sign, moved = await _moved(console, axis, binding["scale"], again=axis["name"] in driven)
    driven.add(axis["name"])
    direction = -sign if binding["invert_pad"] else sign
    rendered = await _rendered(console)
    for _ in range(TRIES):
        await console.pad.press(RB)
        if binding["pad"] in STICKS:
            await console.pad.tilt(STICKS[binding["pad"]], direction)
        else:
            await console.pad.press(BUTTONS[binding["pad"]][direction > 0])
        await console.until(f"!s.armed || ({moved})")
        if not await console.was_held_up():
            break
        await _let_go(console, binding, direction)
        await console.until("s.connected && s.at_rest === true")
        await console.arm()
    await console.until(moved)
    for name, count in rendered.items():
        await console.until(f"s.streams['{name}'].rendered > {count}")
    await _let_go(console, binding, direction)
    await console.until("!s.driving && s.at_rest === true", 30)


async def _moved(console: ConsolePage, axis: Any, scale: float, *, again: bool) -> tuple[int, str]:
    """Return the direction to drive an axis in, and the condition that it has moved.

    A rate axis that was driven before goes back: on a busy machine it may have come to the end of its range. A goal
    axis goes to the wider side of its range; it is its applied goal that moves: five joints cannot turn a tool every
    way.
    """
    name = axis["name"]
    if axis["kind"] == "rate":
        sign = -1 if again and axis["minimum"] < axis["rest"] else 1
        share = MOVED * scale * abs(axis["maximum" if sign > 0 else "minimum"] - axis["rest"])
        return sign, f"{sign} * (s.axes['{name}'] - {axis['rest']}) > {share}"
    start = (await console.stats())["goals"][name]
    sign = 1 if start <= (axis["minimum"] + axis["maximum"]) / 2 else -1
    return sign, f"{sign} * (s.goals['{name}'] - {start}) > {MOVED * scale * min(axis['reach'], axis['slew'])}"


async def _let_go(console: ConsolePage, binding: Any, direction: int) -> None:
    if binding["pad"] in STICKS:
        await console.pad.tilt(STICKS[binding["pad"]], 0)
    else:
        await console.pad.press(BUTTONS[binding["pad"]][direction > 0], False)
    await console.pad.press(RB, False)


async def _rendered(console: ConsolePage) -> dict[str, int]:
    streams = (await console.stats())["streams"]
    return {name: stream["rendered"] for name, stream in streams.items() if stream["kind"] == "video"}


async def _saw_every_camera(console: ConsolePage, robot: Any) -> None:
    """With a stamp, and within the tolerance, every single picture."""
    statistics = await console.stats()
    for camera in robot["cameras"]:
        stream = statistics["streams"][camera["name"]]
        assert stream["stamp"] is not None, camera["name"]
        assert stream["violations"] == 0, camera["name"]
        assert stream["max_gap"] <= statistics["tolerance"]["video"], camera["name"]
    await console.until("s.faults.length === 0")
    assert statistics["bad_messages"] == 0


async def _stop_and_reset(console: ConsolePage) -> None:
    await console.pad.press(STOP_BUTTON)
    await console.until("s.stop.stopped && !s.armed && s.at_rest === true")
    await console.pad.press(STOP_BUTTON, False)
    await console.reset()
    await console.until("!s.stop.stopped && s.at_rest === true")


async def _no_stamp_is_newer_than_the_truth(stack: Stack, robot: Any) -> None:
    """By the bridge's own record: what a picture is stamped with held when it was captured."""
    began: dict[int, float] = {}
    for record in await stack.events("feedback"):
        began.setdefault(record["event"], record["time"])
    stamped = [record for record in await stack.events("media") if record["captured"] < record["time"]]
    assert {record["stream"] for record in stamped} >= {camera["name"] for camera in robot["cameras"]}
    newer = [record for record in stamped if began[record["event"]] > record["captured"]]
    assert newer == []


async def _nothing_executed_twice(stack: Stack) -> None:
    executed = [record["event"] for record in await stack.events("executed")]
    assert executed
    assert executed == sorted(set(executed))
