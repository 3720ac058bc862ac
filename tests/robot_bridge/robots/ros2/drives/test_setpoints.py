"""From joint velocities to where the joints are wanted."""

import math

import pytest

from lockstep.robot_bridge.robots.ros2.drives.setpoints import Setpoints


def test_a_motion_begins_where_the_arm_is() -> None:
    setpoints = Setpoints([1.0, 1.0])
    assert setpoints.points == []
    setpoints.begin([0.3, -0.2])
    setpoints.advance([1.0, 0.0], [0.3, -0.2], 0.01)
    assert setpoints.points == pytest.approx([0.31, -0.2])


def test_a_setpoint_waits_for_a_joint_that_is_blocked() -> None:
    setpoints = Setpoints([0.05])
    setpoints.begin([0.0])
    for _ in range(100):
        setpoints.advance([1.0], [0.0], 0.01)
    assert setpoints.points == [0.05]


def test_what_lies_ahead_is_the_way_of_the_horizon() -> None:
    setpoints = Setpoints([1.0])
    setpoints.begin([2.0])
    assert setpoints.ahead([-0.5], 0.1) == pytest.approx([1.95])
    assert setpoints.points == [2.0]


def test_an_unknown_position_leaves_the_setpoint_where_it_is() -> None:
    setpoints = Setpoints([1.0])
    setpoints.begin([2.0])
    setpoints.advance([1.0], [math.nan], 0.01)
    assert setpoints.points == [2.0]
