"""An action that takes goal axes to a posture."""

import math

import pytest

from lockstep.protocol.description import Axis
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionStep
from lockstep.robot_bridge.robots.go_to import GoTo

RATE = Axis(name="base", label="Base", unit="m/s", minimum=-1.0, maximum=1.0, slew=4.0, brake=8.0)
JOINT = Axis(name="joint", label="Joint", unit="rad", minimum=-2.0, maximum=2.0, slew=1.0, brake=4.0, kind="goal")
SLIDE = Axis(name="slide", label="Slide", unit="m", minimum=0.0, maximum=0.1, slew=1.0, brake=4.0, kind="goal")
TURNER = Axis(
    name="turner",
    label="Turner",
    unit="rad",
    minimum=-math.pi,
    maximum=math.pi,
    slew=1.0,
    brake=4.0,
    kind="goal",
    wrap=math.tau,
)
HAND = Axis(
    name="hand", label="Hand", unit="rad", minimum=0.0, maximum=2.0, slew=1.0, brake=4.0, kind="goal", grips=True
)


def go_to(goals: dict[int, float], axes: list[Axis], measured: list[float]) -> GoTo:
    return GoTo(goals, axes, lambda: measured, 0.1, "there", "blocked")


def last(run: GoTo) -> ActionStep:
    """Return the last step of a run in which nothing moves."""
    steps = [run.step()]
    while not steps[-1].done and len(steps) < 50:
        steps.append(run.step())
    return steps[-1]


def test_axes_without_a_goal_stay_or_rest() -> None:
    step = go_to({2: 0.05}, [RATE, JOINT, SLIDE], [0.0, 1.0, 0.0]).step()
    assert (step.values, step.done, step.progress) == ([0.0, None, 0.05], False, 0.0)


def test_it_says_that_it_is_there_only_when_it_is() -> None:
    measured = [0.0]
    run = go_to({0: 1.0}, [JOINT], measured)
    assert run.step().text == "on its way"
    measured[0] = 1.0
    assert run.step().text == "there"


@pytest.mark.parametrize(
    ("axis", "goal", "place", "is_there"),
    [
        (JOINT, 1.0, 1.029, True),
        (JOINT, 1.0, 1.031, False),
        (SLIDE, 0.05, 0.0519, True),
        (SLIDE, 0.05, 0.0521, False),
        (TURNER, 3.14, -3.14 + 2 * math.tau, True),
    ],
)
def test_what_counts_as_there(axis: Axis, goal: float, place: float, *, is_there: bool) -> None:
    assert go_to({0: goal}, [axis], [place]).step().done == is_there


def test_it_fails_when_nothing_gets_nearer_for_two_seconds() -> None:
    with pytest.raises(ActionFailed, match="blocked"):
        last(go_to({0: 1.0, 1: 0.0}, [JOINT, HAND], [0.0, 0.0]))


def test_what_a_gripper_holds_does_not_make_it_fail() -> None:
    assert last(go_to({0: 1.0, 1: 0.0}, [JOINT, HAND], [1.0, 0.5])).done


def test_a_gripper_alone_that_does_not_get_there_fails() -> None:
    with pytest.raises(ActionFailed, match="blocked"):
        last(go_to({0: 1.0}, [HAND], [0.5]))


@pytest.mark.parametrize("measured", [[math.nan, 0.0], [0.0, math.nan]])
def test_it_fails_where_a_joint_is_not_known(measured: list[float]) -> None:
    with pytest.raises(ActionFailed, match="not known"):
        go_to({0: 0.0, 1: 0.0}, [JOINT, HAND], measured).step()
