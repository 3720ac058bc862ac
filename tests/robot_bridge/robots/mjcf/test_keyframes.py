"""Named keyframes of a model are actions that take its goal axes there."""

import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lockstep.protocol.messages import Feedback, Stop
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.robots.actions import ActionNotPossible
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
from tests.robot_bridge.bridge_helpers import Operator, operator, running_bridge
from tests.robot_bridge.robots.mjcf.models import model_file, one_joint
from tests.robot_bridge.robots.mjcf.tools.arms import TOOL, arm_model
from tests.robot_bridge.robots.pose_driver import ended, send_to

SERVO = '<position name="servo" joint="j" kp="400" kv="40"/>'
GOALS = '<custom><text name="lockstep_goals" data="servo"/></custom>'
KEYS = """<keyframe><key qpos="0.1"/><key name="look_up" qpos="-0.8"/><key name="far" qpos="3"/>
<key name="by_ctrl" qpos="0.2" ctrl="0.4"/></keyframe>"""


@contextmanager
def robot_of(
    directory: Path, keys: str, *, goals: str = GOALS, servo: str = SERVO, joint: str = ""
) -> Iterator[MjcfRobot]:
    given = {"joint": joint} if joint else {}
    robot = create(model_file(directory, one_joint(servo, more=goals + keys, **given)))
    assert isinstance(robot, MjcfRobot)
    yield robot
    robot.close()


def goal(robot: MjcfRobot, name: str) -> float | None:
    values = robot.begin_action(name, {}).step().values
    assert values is not None
    return values[0]


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[MjcfRobot]:
    with robot_of(tmp_path, KEYS) as robot:
        yield robot


def test_named_keys_are_moving_actions(arm: MjcfRobot) -> None:
    check_description(arm.describe())
    actions = [(action.name, action.label, action.moves) for action in arm.describe().actions]
    assert actions == [("look_up", "Look up", True), ("far", "Far", True), ("by_ctrl", "By ctrl", True)]


def test_a_key_goes_to_its_ctrl_or_else_to_its_qpos_within_the_range(arm: MjcfRobot) -> None:
    assert [goal(arm, name) for name in ("look_up", "far", "by_ctrl")] == [-0.8, 1.0, 0.4]


def test_the_log_names_a_key_out_of_range_and_one_that_is_not_finite(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    keys = '<keyframe><key qpos="0"/><key name="far" qpos="3"/><key name="bad" qpos="inf"/></keyframe>'
    with caplog.at_level(logging.WARNING), robot_of(tmp_path, keys) as robot:
        assert [action.name for action in robot.describe().actions] == ["far"]
    assert "keyframe far: servo goes to 1, the end of its range, not to 3" in caplog.text
    assert "left out: bad" in caplog.text


def test_a_keys_ctrl_is_divided_by_the_gear(tmp_path: Path) -> None:
    servo = '<position name="servo" joint="j" kp="400" kv="40" gear="-2"/>'
    with robot_of(tmp_path, '<keyframe><key name="up" ctrl="0.6"/></keyframe>', servo=servo) as robot:
        assert goal(robot, "up") == pytest.approx(-0.3)


def test_a_key_beyond_half_a_turn_is_wrapped_where_the_axis_is(tmp_path: Path) -> None:
    keys = '<keyframe><key qpos="0"/><key name="turned" qpos="4"/></keyframe>'
    with robot_of(tmp_path, keys, joint='type="hinge" axis="0 0 1"') as robot:
        assert goal(robot, "turned") == pytest.approx(4 - math.tau)


def test_keys_of_a_model_whose_axes_are_rates_are_left_out(tmp_path: Path) -> None:
    with robot_of(tmp_path, KEYS, goals="") as robot:
        assert robot.describe().actions == ()


def test_names_are_made_printable_and_keys_beyond_twelve_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    names = ["a\u202eb", "a_b", "x" * 250, *(f"key{number}" for number in range(12))]
    keys = "".join(f'<key name="{name}" qpos="0.3"/>' for name in names)
    with caplog.at_level(logging.WARNING), robot_of(tmp_path, f"<keyframe>{keys}</keyframe>") as robot:
        check_description(robot.describe())
        actions = [action.name for action in robot.describe().actions]
    assert actions == ["a_b", "x" * 200, *(f"key{number}" for number in range(10))]
    assert "left out: a_b, key10, key11" in caplog.text


def test_the_joints_of_a_tool_go_and_its_pose_and_the_rates_do_not(tmp_path: Path) -> None:
    robot = create(model_file(tmp_path, arm_model(more=TOOL)))
    robot_values = robot.begin_action("home", {}).step()
    check_description(robot.describe())
    robot.close()
    assert robot_values.done, "it begins there"


def test_a_stopped_robot_begins_none(arm: MjcfRobot) -> None:
    arm.stop()
    with pytest.raises(ActionNotPossible, match="stopped"):
        arm.begin_action("look_up", {})


def has_begun(feedback: Feedback) -> bool:
    return feedback.axes[0] < -0.1


async def test_an_operator_sends_the_robot_there_while_armed_events_renew_it(arm: MjcfRobot) -> None:
    async with running_bridge(arm) as bridge, operator(bridge) as driver:
        told = await send_to(driver, "look_up")
        assert told is not None
        assert (told.state, told.text) == ("done", "Look up")
        await driver.heard(lambda feedback: feedback.at_rest)
        assert driver.feedback.axes[0] == pytest.approx(-0.8, abs=0.05)


@pytest.mark.parametrize("reason", ["driving", "stopped", "not_renewed"])
async def test_a_stick_a_stop_and_silence_cancel_it(arm: MjcfRobot, reason: str) -> None:
    async with running_bridge(arm) as bridge, operator(bridge) as driver:
        await send_to(driver, "look_up", until=has_begun)
        if reason == "driving":
            driver.link.send(driver.command([driver.feedback.axes[0]]))
        elif reason == "stopped":
            driver.link.send(Stop(by="test", reason="a test"))
        told = await ended(driver)
        assert (told.state, told.reason) == ("cancelled", reason)
        await stays_short(driver)


async def test_it_ends_with_the_link(arm: MjcfRobot) -> None:
    async with running_bridge(arm) as bridge:
        async with operator(bridge) as driver:
            await send_to(driver, "look_up", until=has_begun)
        async with operator(bridge, armed=False) as driver:
            await stays_short(driver)


async def stays_short(driver: Operator) -> None:
    await driver.heard(lambda feedback: feedback.at_rest)
    assert driver.feedback.axes[0] > -0.7
