import numpy as np
import pytest

from lockstep.robot_bridge.kinematics.clearance import Gap
from lockstep.robot_bridge.kinematics.gap_limits import gap_limits

GAIN, CLOSE = 8.0, 0.01  # 1/s and m
ZERO = np.zeros(2)


def gap(distance: float, *gradient: float, what: str = "itself") -> Gap:
    return Gap(distance, np.array(gradient), what)


def test_a_gap_may_become_narrower_the_more_slowly_the_narrower_it_is() -> None:
    limits = gap_limits([gap(0.03, 1.0, 0.0), gap(0.005, 0.0, 2.0), gap(0.02, 1.0, 1.0)], 2, GAIN, CLOSE)
    assert limits.most.tolist() == pytest.approx([0.16, 0.08, 0.0]), (
        "the narrowest last; below `close` it may not at all"
    )
    assert limits.steep.tolist() == pytest.approx([1.0, 2.0**0.5, 2.0])


def test_a_gap_that_no_joint_changes_is_left_out() -> None:
    limits = gap_limits([gap(0.005, 0.0, 0.0, what="itself"), gap(0.02, 0.0, 1.0, what="the table")], 2, GAIN, CLOSE)
    assert limits.what == ("the table",)
    assert limits.gradients.tolist() == [[0.0, 1.0]]


def test_without_gaps_any_rates_are_kept() -> None:
    limits = gap_limits([], 2, GAIN, CLOSE)
    rates = np.array((3.0, -4.0))
    assert limits.narrowed(rates) is None
    assert limits.apart(rates) == (rates, ())
    assert limits.changed(rates, rates - 1.0, rates + 1.0, ZERO).tolist() == [3.0, -4.0]


def test_rates_are_taken_back_to_what_each_gap_allows() -> None:
    limits = gap_limits([gap(0.03, 1.0, 0.0), gap(0.02, 0.0, 1.0, what="the table")], 2, GAIN, CLOSE)
    assert limits.narrowed(np.array((-0.1, -0.05))) is None
    assert limits.narrowed(np.array((-0.2, -1.0))) == 1, "the one that is narrowed the most above what it allows"
    rates, near = limits.apart(np.array((-1.0, -1.0)))
    assert rates.tolist() == pytest.approx([-0.16, -0.08])
    assert [limits.what[number] for number in near] == ["itself", "the table"]


def test_rates_that_a_joint_can_have_now_keep_a_gap_by_the_other_joint() -> None:
    limits = gap_limits([gap(CLOSE, 0.3, 1.0)], 2, GAIN, CLOSE)
    # The first joint still goes towards the obstacle; the second leads away from it as fast.
    rates = limits.changed(np.array((-1.0, 0.0)), np.array((-1.0, -2.0)), np.array((-0.9, 2.0)), ZERO)
    assert 0.3 * rates[0] + rates[1] >= -1e-5
    assert -1.0 <= rates[0] <= -0.9


def test_all_joints_brake_where_nothing_else_keeps_a_gap_better() -> None:
    limits = gap_limits([gap(CLOSE, 1.0, 0.0)], 2, GAIN, CLOSE)
    braked = np.array((-0.5, 0.0))
    lowest, highest = np.array((-1.0, -1.0)), np.array((-0.8, 1.0))
    assert limits.changed(np.array((-1.0, 0.0)), lowest, highest, braked) is braked
