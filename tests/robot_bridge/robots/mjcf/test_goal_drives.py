"""Position servos that a model's own setting makes goal axes."""

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.robot_bridge.conformance import CASES, Outcome, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import ModelError
from lockstep.robot_bridge.robots.mjcf import create
from lockstep.robot_bridge.robots.mjcf.robot import MjcfRobot
from tests.robot_bridge.bridge_helpers import operator, running_bridge
from tests.robot_bridge.robots.mjcf.models import model_file, one_joint

SERVO = '<position name="servo" joint="j" kp="40" kv="4"/>'  # so weak that the bar hangs below its goal
GOALS = '<custom><text name="lockstep_goals" data="{}"/></custom>'


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


async def test_the_bridges_of_models_pass_the_cases_about_goals(arm: MjcfRobot) -> None:
    async with running_bridge(arm) as bridge:
        subject = Subject(Place(*bridge.address))
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
