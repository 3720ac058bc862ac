import numpy as np
import pytest

from lockstep.robot_bridge.kinematics.task_order import Damping, task_order

SHARP = Damping(small=1e-3, most=1e-6)  # next to no damping
FREE = np.ones(3, dtype=bool)
NO_GAPS = (np.zeros((0, 3)), np.zeros(0), np.zeros(0))
FIRST = np.array(((1.0, 1.0, 0.0),))
SECOND = np.array(((0.0, 1.0, 1.0),))
STILL = np.zeros(3)


def test_both_tasks_are_done_where_both_can_be() -> None:
    order = task_order([(FIRST, SHARP), (SECOND, SHARP)], FREE, *NO_GAPS)
    rates = order.rates([np.array((0.3,)), np.array((-0.2,))], [0.0, 0.0], STILL, None)
    assert (FIRST @ rates).tolist() == pytest.approx([0.3], abs=1e-6)
    assert (SECOND @ rates).tolist() == pytest.approx([-0.2], abs=1e-6)


def test_the_first_task_is_done_where_they_exclude_each_other() -> None:
    order = task_order([(FIRST, SHARP), (FIRST, SHARP)], FREE, *NO_GAPS)
    rates = order.rates([np.array((0.3,)), np.array((-0.2,))], [0.0, 0.0], STILL, None)
    assert (FIRST @ rates).tolist() == pytest.approx([0.3], abs=1e-4)


def test_a_joint_that_is_held_is_reckoned_with_and_does_not_change() -> None:
    held, free = np.array((0.5, 0.0, 0.0)), np.array((False, True, True))
    order = task_order([(FIRST, SHARP)], free, *NO_GAPS)
    rates = order.rates([np.array((0.3,))], [0.0], held, None)
    assert rates[0] == 0.0
    assert (FIRST @ (rates + held)).tolist() == pytest.approx([0.3], abs=1e-6)


def test_a_gap_that_binds_comes_before_all_tasks() -> None:
    gradients, most, steep = np.array(((2.0, 0.0, 0.0),)), np.array((0.1,)), np.array((2.0,))
    order = task_order([(np.array(((1.0, 0.0, 0.0),)), SHARP)], FREE, gradients, most, steep)
    rates = order.rates([np.array((-5.0,))], [0.0], STILL, None)
    assert (gradients @ rates).tolist() == pytest.approx([-0.1], abs=1e-3), "it becomes narrower by what it may"


def test_further_damping_shortens_a_step_and_a_pull_acts_on_what_is_left_alone() -> None:
    order = task_order([(FIRST, SHARP)], FREE, *NO_GAPS)
    whole, damped = (order.rates([np.array((1.0,))], [residual], STILL, None) for residual in (0.0, 2.0))
    assert (FIRST @ damped).item() == pytest.approx((FIRST @ whole).item() / 2.0, abs=1e-3)
    pulled = order.rates([np.array((1.0,))], [0.0], STILL, np.array((1.0, 0.0, 1.0)))
    assert (FIRST @ pulled).item() == pytest.approx(1.0, abs=1e-3)
    assert pulled[2] == pytest.approx(1.0)


def test_a_direction_that_is_nearly_singular_is_damped() -> None:
    order = task_order([(1e-2 * FIRST, Damping(small=0.1, most=0.1))], FREE, *NO_GAPS)
    rates = order.rates([np.array((1.0,))], [0.0], STILL, None)
    assert np.abs(rates).max() < 2.0, "seventy without damping"
