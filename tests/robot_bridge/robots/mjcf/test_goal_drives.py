"""Position servos that a model's own setting makes goal axes."""

import asyncio
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.protocol.messages import Stop
from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
from tests.robot_bridge.bridge_helpers import PATIENCE, operator, running_bridge
from tests.robot_bridge.robots.mjcf.models import model_file, one_joint
from tests.robot_bridge.robots.mjcf.tools.arms import TOOL, arm_model

SERVO = '<position name="servo" joint="j" kp="40" kv="4"/>'  # so weak that the bar hangs below its goal
GOALS = '<custom><text name="lockstep_goals" data="{}"/></custom>'
GRIPPERS = '<custom><text name="lockstep_grippers" data="{}"/></custom>'
# Beside the bar, another one on a servo that presses it against a peg.
HAND = """<mujoco><compiler angle="radian" autolimits="true"/><option timestep="0.002" integrator="implicitfast"/>
<worldbody><body pos="0 0 1"><joint name="lift" axis="0 1 0" range="-1 1"/>
<geom type="box" size="0.2 0.02 0.02" pos="0.2 0 0" mass="0.5"/></body>
<body pos="0 1 1"><joint name="jaw" axis="0 0 1" range="-1 1"/>
<geom type="box" size="0.2 0.02 0.02" pos="0.2 0 0" mass="0.1"/></body>
<geom type="box" size="0.02 0.02 0.1" pos="0.38 1.1 1"/></worldbody>
<actuator><position name="lift" joint="lift" kp="{kp}" kv="0.2"/><position name="jaw" joint="jaw" kp="40" kv="4"/>
</actuator><custom><text name="lockstep_goals" data="lift"/>{more}</custom></mujoco>"""
JAW = '<text name="lockstep_grippers" data="jaw"/>'


def model(directory: Path, data: str = "servo", actuator: str = SERVO, joint: str | None = None) -> Path:
    given = {} if joint is None else {"joint": joint}
    return model_file(directory, one_joint(actuator, more=GOALS.format(data), **given))


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[MjcfRobot]:
    robot = create(model(tmp_path))
    assert isinstance(robot, MjcfRobot)
    yield robot
    robot.close()


def test_a_servo_that_the_setting_names_is_a_goal_axis_within_the_joints_range(arm: MjcfRobot) -> None:
    description = arm.describe()
    check_description(description)
    axis = description.axes[0]
    assert (axis.kind, axis.unit, axis.minimum, axis.maximum, axis.wrap) == ("goal", "rad", -1.0, 1.0, None)
    assert axis.slew == 0.5  # 2 rad in 4 s
    assert axis.reach == 0.5
    assert description.layers == ()
    assert description.position_limits == ()


def test_a_hinge_without_ends_wraps(tmp_path: Path) -> None:
    robot = create(model(tmp_path, joint='type="hinge" axis="0 0 1"'))
    axis = robot.describe().axes[0]
    check_description(robot.describe())
    robot.close()
    assert (axis.minimum, axis.maximum, axis.wrap) == (-math.pi, math.pi, math.tau)


@pytest.mark.parametrize(
    ("data", "actuator", "joint", "words"),
    [
        ("elbow", SERVO, None, "names 'elbow', which is no position actuator of a joint; there are: servo"),
        ("servo", '<motor name="servo" joint="j"/>', None, "there are: none"),
        ("servo", SERVO, 'type="slide" axis="1 0 0"', "neither its joint nor it has a range"),
    ],
)
def test_what_cannot_be_a_goal_axis_is_refused_in_words(
    tmp_path: Path, data: str, actuator: str, joint: str | None, words: str
) -> None:
    with pytest.raises(ModelError, match=words):
        create(model(tmp_path, data, actuator, joint))


def test_all_names_every_servo_and_no_other_actuator(tmp_path: Path) -> None:
    robot = create(model(tmp_path, "all", SERVO + '<motor name="motor" joint="j"/>'))
    kinds = [axis.kind for axis in robot.describe().axes]
    robot.close()
    assert kinds == ["goal", "rate"]


def test_a_gripper_that_the_setting_names_is_a_goal_axis_that_squeezes(tmp_path: Path) -> None:
    robot = create(model_file(tmp_path, HAND.format(kp=40, more=JAW)))
    description = robot.describe()
    robot.close()
    check_description(description)
    assert [(axis.name, axis.kind, axis.grips) for axis in description.axes] == [
        ("lift", "goal", False),
        ("jaw", "goal", True),
    ]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("claw", "lockstep_grippers names 'claw', which is no position actuator of a joint; there are: waist"),
        ("gripper elbow", "lockstep_grippers names 'elbow', which moves a tool: a gripper is a joint of the hand"),
    ],
)
def test_what_cannot_be_a_gripper_is_refused_in_words(tmp_path: Path, data: str, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        create(model_file(tmp_path, arm_model(more=TOOL + GRIPPERS.format(data))))


async def test_a_gripper_squeezes_on_after_a_reset_though_the_arm_has_fallen_from_its_goal(tmp_path: Path) -> None:
    robot = create(model_file(tmp_path, HAND.format(kp=0.1, more=JAW)))  # the lift's servo carries next to nothing
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        while driver.feedback.goals[1] != 0.4:
            await driver.drive([None, 0.4])
        await driver.heard(lambda feedback: feedback.at_rest)
        lift, jaw = driver.feedback.axes
        fallen, _ = driver.feedback.goals
        assert fallen is not None
        assert lift - fallen > driver.link.hello.description.axes[0].reach  # type: ignore[union-attr]
        assert 0.1 < jaw < 0.35  # against the peg
        driver.link.send(Stop(by="test", reason="a test"))
        await driver.heard(lambda feedback: feedback.stop.stopped)
        await driver.reset()
        await driver.arm()
        assert driver.feedback.goals == [pytest.approx(driver.feedback.axes[0], abs=0.01), 0.4]


async def test_it_is_driven_to_a_goal_and_does_not_creep_down_under_its_load(arm: MjcfRobot) -> None:
    async with running_bridge(arm) as bridge, operator(bridge) as driver:
        while driver.feedback.goals != [-0.2]:
            await driver.drive([-0.2])
        for _ in range(10):
            await driver.drive([driver.feedback.goals[0]])
            await driver.drive([None])
        assert driver.feedback.goals == [-0.2]
        await driver.heard(lambda feedback: feedback.at_rest)
        assert driver.feedback.axes[0] > -0.19  # it hangs; the axis turns downwards


async def test_after_a_simulation_began_anew_the_arm_is_held_where_it_is_then(arm: MjcfRobot) -> None:
    async with running_bridge(arm) as bridge, operator(bridge) as driver, asyncio.timeout(PATIENCE):
        begun = driver.feedback.axes[0]
        while driver.feedback.goals != [-0.2]:
            await driver.drive([-0.2])
        await driver.drive([None])
        await driver.heard(lambda feedback: feedback.at_rest)
        arm.simulation.data.qvel[:] = math.nan
        await driver.heard(lambda feedback: feedback.goals != [-0.2])
        assert driver.feedback.goals == [pytest.approx(begun, abs=0.01)]


async def test_the_bridges_of_models_pass_the_cases_about_goals(arm: MjcfRobot) -> None:
    async with running_bridge(arm) as bridge:
        subject = Subject(Place(*bridge.address), settle=PATIENCE)
        results = {}
        for case in CASES:
            if case.name.startswith("goal") or case.name in (
                "executes",
                "hold",
                "rest",
                "lost_link",
                "reset_then_neutral",
            ):
                results[case.name] = await play(subject, case)
                await subject.clean_up()
    skipped = {name for name, result in results.items() if result.outcome is Outcome.NOT_APPLICABLE}
    assert skipped == {"goal_wrap", "goal_conflict"}
    assert {name: result.detail for name, result in results.items() if result.outcome is Outcome.FAILED} == {}
