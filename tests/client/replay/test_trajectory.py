"""Which recordings fit which robot."""

import math

import pytest

from lockstep.client.replay.errors import ReplayUnfit
from lockstep.client.replay.trajectory import Trajectory, fit
from tests.client.live.goal_robot import ARM


def recorded(**more: object) -> Trajectory:
    given: dict[str, object] = {"times": [5.0, 5.1], "action_names": ["j1.pos"], "actions": [[0.1], [0.2]]} | more
    return Trajectory(**given)  # type: ignore[arg-type]


def test_names_of_lerobot_and_of_the_robot_both_fit_and_times_begin_at_zero() -> None:
    for name in ("j1", "j1.pos"):
        fitted = fit(recorded(action_names=[name]), ARM)
        assert [row.values for row in fitted.rows] == [{"j1": 0.1}, {"j1": 0.2}]
        assert [row.time for row in fitted.rows] == pytest.approx([0.0, 0.1])
        assert fitted.start == {"j1": 0.1}


def test_the_beginning_is_where_the_arm_was_measured_not_where_it_was_told_to_be() -> None:
    fitted = fit(recorded(state_names=["j1.pos", "x.pos"], states=[[0.3, 9.0], [0.3, 9.0]]), ARM)
    assert fitted.start == {"j1": 0.3}


def test_a_rate_has_no_beginning() -> None:
    assert fit(recorded(action_names=["base.vel"]), ARM).start == {}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"action_names": ["j9.pos"]}, "no axis for j9.pos"),
        ({"action_names": ["j1.vel"]}, "no axis for j1.vel"),
        ({"actions": [[0.1], [45.0]]}, "row 1 asks for 45"),
        ({"actions": [[0.1], [math.nan]]}, "not finite in row 1"),
        ({"units": {"j1.pos": "deg"}}, "recorded in deg"),
        ({"actions": [], "times": []}, "no rows"),
        ({"times": [math.nan, 5.1]}, "not a number"),
        ({"times": [5.0, math.inf]}, "not a number"),
        ({"times": [5.0, 4.9]}, "go down"),
    ],
)
def test_what_does_not_fit_is_said_by_name(more: dict[str, object], said: str) -> None:
    with pytest.raises(ReplayUnfit, match=said):
        fit(recorded(**more), ARM)


def test_a_value_just_beyond_its_range_is_one_that_the_bridge_clamps() -> None:
    assert fit(recorded(actions=[[2.01], [0.0]]), ARM).rows[0].values == {"j1": 2.01}


def test_a_state_that_is_not_a_number_was_not_measured() -> None:
    fitted = fit(recorded(state_names=["j1.pos"], states=[[math.nan], [0.2]]), ARM)
    assert [row.state for row in fitted.rows] == [{}, {"j1": 0.2}]
    assert fitted.start == {"j1": 0.1}
