"""What is driven when, and when a replay ends."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.control.clutch import REACH_SHARE
from lockstep.client.replay.errors import ReplayDeviated, ReplayTooFar, ReplayUnfit
from lockstep.client.replay.replay_core import HELD, SETTLE, ReplayCore
from lockstep.client.replay.trajectory import Trajectory, fit
from lockstep.protocol.messages import Feedback
from tests.client.live.goal_robot import ARM

BASE, J1, J2 = 0, 1, 2
REACH = 0.4


def core(times: list[float], j1: list[float], pace: float = 1.0, names: str = "j1.pos") -> ReplayCore:
    rows = [[each] for each in j1]
    found = Trajectory(times=times, action_names=[names], actions=rows, state_names=["j1.pos"], states=rows)
    return ReplayCore(fit(found, ARM), ARM, pace)


def at(j1: float) -> Feedback:
    return Feedback(event=1, issue=1, time=0.0, axes=[0.0, j1, 0.0], goals=[None, j1, 0.0])


def test_the_newest_row_that_is_due_is_driven_and_others_are_skipped() -> None:
    found = core([0.0, 0.1, 0.2, 0.3], [0.0, 0.1, 0.2, 0.3])
    assert [found.values(t, at(0.0)) for t in (0.0, 0.05, 0.25)] == [
        [0.0, 0.0, None],
        [0.0, 0.0, None],
        [0.0, 0.2, None],
    ]
    assert found.report.driven == 2


def test_it_ends_a_moment_after_the_last_row() -> None:
    found = core([0.0, 0.1], [0.0, 0.1])
    assert found.values(0.1 + SETTLE, at(0.1)) is not None
    assert found.values(0.1 + SETTLE + 0.01, at(0.1)) is None


def test_a_pause_of_the_operator_is_a_pause_and_not_a_rate_that_goes_on() -> None:
    found = core([0.0, 5.0], [0.5, 0.5], names="base.vel")
    assert found.values(HELD, at(0.5)) == [0.5, None, None]
    assert found.values(HELD + 0.1, at(0.5)) == [0.0, None, None]
    assert found.values(5.0, at(0.5)) == [0.5, None, None]


def test_at_half_the_pace_each_row_comes_twice_as_late() -> None:
    found = core([0.0, 1.0], [0.0, 0.1], pace=0.5)
    assert found.values(1.9, at(0.0)) != found.values(2.0, at(0.0))


@given(st.floats(-2, 2), st.floats(-2, 2))
def test_no_goal_is_further_than_the_robot_takes(measured: float, goal: float) -> None:
    values = core([0.0], [goal]).values(0.0, at(measured))
    assert values is not None
    value = values[J1]
    assert value is not None
    assert abs(value - measured) <= REACH_SHARE * REACH + 1e-9


def test_a_robot_that_is_not_where_the_episode_begins_is_refused_by_name() -> None:
    found = core([0.0], [0.5])
    found.check_start(at(0.5 + REACH - 0.01))
    with pytest.raises(ReplayTooFar, match="j1 is at 1 rad, and the episode begins at 0.5 rad"):
        found.check_start(at(1.0))


def test_a_robot_that_does_not_follow_ends_the_replay() -> None:
    found = core([0.0], [0.5])
    found.values(0.0, at(0.5))
    found.heard(at(0.4))
    with pytest.raises(ReplayDeviated, match="j1 is at 0"):
        found.heard(at(0.0))
    assert found.report.deviation["j1"] == pytest.approx(0.5)


def test_a_place_that_is_not_a_number_is_neither_near_nor_followed() -> None:
    found = core([0.0], [0.5])
    with pytest.raises(ReplayTooFar):
        found.check_start(at(math.nan))
    found.values(0.0, at(0.5))
    with pytest.raises(ReplayDeviated):
        found.heard(at(math.nan))


@pytest.mark.parametrize("pace", [0.0, -1.0, math.nan, math.inf])
def test_a_pace_at_which_the_replay_would_never_end_is_refused(pace: float) -> None:
    with pytest.raises(ReplayUnfit, match="a pace is a number above 0"):
        core([0.0, 0.1], [0.5, 0.5], pace=pace)
