"""When a picture was captured."""

import pytest

from lockstep.robot_bridge.robots.ros2.sensing.capture_time import ClockMismatch, captured_at

SECOND = 1_000_000_000
NOW_ROS = 1_700_000_000 * SECOND


def test_a_header_stamp_is_as_old_on_our_clock_as_on_its_own() -> None:
    captured = captured_at("header", arrived=50.0, arrived_ros=NOW_ROS, header=NOW_ROS - SECOND // 4, latency=0.0)
    assert captured == pytest.approx(49.75)


def test_the_latency_makes_a_picture_older_never_newer() -> None:
    assert captured_at("header", arrived=50.0, arrived_ros=NOW_ROS, header=NOW_ROS, latency=0.1) == pytest.approx(49.9)
    assert captured_at("arrival", arrived=50.0, arrived_ros=NOW_ROS, header=0, latency=0.1) == pytest.approx(49.9)


def test_where_arrival_tells_the_time_the_header_does_not_matter() -> None:
    assert captured_at("arrival", arrived=50.0, arrived_ros=NOW_ROS, header=NOW_ROS + SECOND, latency=0.0) == 50.0


@pytest.mark.parametrize(
    ("header", "complaint"),
    [(0, "without a header stamp"), (NOW_ROS + 1, "from the future"), (NOW_ROS - 11 * SECOND, "far in the past")],
)
def test_a_stamp_that_our_clock_cannot_have_given_is_refused(header: int, complaint: str) -> None:
    with pytest.raises(ClockMismatch, match=complaint):
        captured_at("header", arrived=50.0, arrived_ros=NOW_ROS, header=header, latency=0.0)
