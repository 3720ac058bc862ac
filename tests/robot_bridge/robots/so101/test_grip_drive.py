import math

import pytest

from lockstep.robot_bridge.robots.so101.grip_drive import GripDrive

RATE, TICK = 2.0, 0.125  # rad/s, s


def test_the_goal_goes_to_a_changed_value_at_its_rate_and_not_beyond() -> None:
    grip = GripDrive(RATE, 0.5)
    assert grip.drive(0.5, TICK) == 0.0
    assert [grip.drive(0.875, TICK) for _ in range(3)] == [RATE, 0.125 / TICK, 0.0]
    assert grip.goal == 0.875


def test_the_first_value_and_the_first_after_a_restart_move_nothing() -> None:
    grip = GripDrive(RATE, 0.5)
    assert grip.drive(0.0, TICK) == 0.0
    assert grip.drive(0.25, TICK) == -RATE
    grip.restart()
    grip.hold()
    assert grip.drive(1.0, TICK) == 0.0
    assert grip.goal == 0.25


def test_it_holds_where_it_is_until_the_values_change() -> None:
    grip = GripDrive(RATE, 0.5)
    grip.drive(0.5, TICK)
    grip.drive(1.0, TICK)
    grip.hold()
    assert grip.drive(1.0, TICK) == 0.0
    assert grip.drive(0.875, TICK) == pytest.approx(0.125 / TICK)
    grip.hold(0.25)
    assert grip.goal == 0.25


def test_a_value_that_is_not_a_number_moves_nothing() -> None:
    grip = GripDrive(RATE, 0.5)
    grip.drive(0.5, TICK)
    assert grip.drive(math.nan, TICK) == 0.0
    assert grip.goal == 0.5
