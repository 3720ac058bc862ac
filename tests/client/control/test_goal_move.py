import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.control.clutch import REACH_SHARE
from lockstep.client.control.goal_move import GoalMove
from lockstep.client.errors import CommandError, GoalNotReached
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Feedback


def _axis(name: str, **fields: Any) -> Axis:
    return Axis(name=name, label=name, unit="rad", minimum=-2, maximum=2, slew=1, brake=4, **fields)


TURN = 2 * math.pi
ARM = RobotDescription(
    name="arm",
    label="Arm",
    axes=(
        _axis("base", rest=0.5),
        _axis("j1", kind="goal", reach=0.5),
        _axis("turn", kind="goal", reach=0.5, wrap=TURN),
    ),
)


def seen(j1: float, turn: float = 0.0, *, applied: float | None = None, goals: bool = True) -> Feedback:
    places = [None, j1 if applied is None else applied, turn] if goals else []
    return Feedback(event=2, issue=1, time=0.0, axes=[0.5, j1, turn], goals=places)


def test_the_other_axes_move_nothing() -> None:
    assert GoalMove(ARM, {"j1": 0.25}, None).values(seen(0.0)) == [0.5, 0.25, None]


def test_a_goal_out_of_reach_is_approached_by_the_share_of_reach() -> None:
    move = GoalMove(ARM, {"j1": 2.0}, None)
    assert move.values(seen(0.0))[1] == pytest.approx(0.4)
    assert move.values(seen(1.0))[1] == pytest.approx(1.4)
    assert move.values(seen(1.8))[1] == 2.0


def test_an_axis_that_turns_on_and_on_takes_the_shorter_way() -> None:
    move = GoalMove(ARM, {"turn": -3.0}, None)
    assert move.values(seen(0.0, 2.0))[2] == pytest.approx(2.4)
    assert move.values(seen(0.0, 3.0))[2] == -3.0


def test_an_applied_goal_that_a_load_has_led_the_robot_away_from_is_not_pulled_back() -> None:
    move = GoalMove(ARM, {"j1": 2.0}, None)
    assert move.values(seen(0.5, applied=0.95))[1] == pytest.approx(0.95)
    assert move.values(seen(0.5, applied=0.6))[1] == pytest.approx(0.9)


def test_it_has_arrived_when_the_measured_value_and_the_applied_goal_are_there() -> None:
    move = GoalMove(ARM, {"j1": 1.0}, 0.1)
    assert not move.arrived(seen(0.95, applied=0.95), 0.0)  # it still moves
    assert not move.arrived(seen(0.85, applied=1.0), 0.0)
    assert not move.arrived(seen(0.95, goals=False), 0.0)
    assert move.arrived(seen(0.95, applied=1.0), 0.0)


def test_the_tolerance_is_given_for_all_axes_or_by_axis_or_a_twentieth_of_reach() -> None:
    near = seen(0.95, applied=1.0)
    assert not GoalMove(ARM, {"j1": 1.0}, None).arrived(near, 0.0)
    assert not GoalMove(ARM, {"j1": 1.0}, {"turn": 0.1}).arrived(near, 0.0)
    assert GoalMove(ARM, {"j1": 1.0}, {"j1": 0.06}).arrived(near, 0.0)
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(CommandError):
            GoalMove(ARM, {"j1": 1.0}, wrong)


def test_without_progress_for_two_seconds_it_has_failed() -> None:
    move = GoalMove(ARM, {"j1": 1.0}, None)
    for number in range(50):  # slow, but it comes nearer
        assert not move.arrived(seen(0.01 * number), number)
    assert not move.arrived(seen(0.49), 50.9)
    with pytest.raises(GoalNotReached) as failed:
        move.arrived(seen(0.48, applied=0.9), 51.5)
    assert (failed.value.axis, failed.value.goal, failed.value.measured, failed.value.applied) == ("j1", 1.0, 0.48, 0.9)


def test_one_axis_that_comes_nearer_gives_the_other_time() -> None:
    move = GoalMove(ARM, {"j1": 1.0, "turn": 1.0}, None)
    for number in range(40):
        assert not move.arrived(seen(0.0, 0.02 * number), float(number))


@pytest.mark.parametrize("goals", [{"j1": 2.5}, {"j1": math.nan}, {"turn": math.inf}, {"base": 1.0}, {"j9": 0.0}, {}])
def test_goals_that_no_axis_takes_are_the_callers_mistake(goals: dict[str, float]) -> None:
    with pytest.raises(CommandError):
        GoalMove(ARM, goals, None)


def test_an_axis_that_turns_on_and_on_has_no_range() -> None:
    assert GoalMove(ARM, {"turn": 7.0}, None).values(seen(0.0, 0.7))[2] == 7.0


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-0.5, 0.5), st.floats(-10, 10), st.floats(-10, 10))
def test_no_goal_is_further_than_the_share_of_reach_or_than_the_applied_goal(
    goal: float, measured: float, lead: float, turn_goal: float, turn: float
) -> None:
    move = GoalMove(ARM, {"j1": goal, "turn": turn_goal}, None)
    _, j1, turned = move.values(seen(measured, turn, applied=measured + lead))
    assert j1 is not None
    assert turned is not None
    most = REACH_SHARE * 0.5
    assert abs(j1 - measured) <= max(most, abs(lead)) + 1e-9
    assert abs(math.remainder(turned - turn, TURN)) <= most + 1e-9


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.02, 0.5))
def test_a_robot_that_follows_always_arrives(goal: float, start: float, step: float) -> None:
    move = GoalMove(ARM, {"j1": goal}, None)
    place = start
    for number in range(1000):
        if move.arrived(seen(place), 0.04 * number):
            break
        wanted = move.values(seen(place))[1]
        assert wanted is not None
        place += min(max(wanted - place, -step), step)
    assert place == pytest.approx(goal, abs=0.0025)
