import math

import pytest

from lockstep.robot_bridge.robots.mobile_manipulator.range_ring import RING
from tests.robot_bridge.robots.mobile_manipulator.driver import Driver


def test_the_ranges_to_the_walls_match_the_room(driver: Driver) -> None:
    ranges = driver.robot.measure().ranges
    quarter = RING.count // 4
    assert ranges[0] == pytest.approx(3.5, abs=0.001)  # ahead, under the table and between its legs
    assert ranges[quarter] == pytest.approx(2.7, abs=0.001)  # left
    assert ranges[2 * quarter] == pytest.approx(2.5, abs=0.001)  # behind
    assert ranges[3 * quarter] == pytest.approx(2.7, abs=0.001)  # right


def test_the_ranges_turn_and_travel_with_the_base(driver: Driver) -> None:
    driver.run(1.0, base_vx=-0.4)
    driver.run(math.pi / 2, base_wz=1.0)
    joints = driver.run(0.5).joints
    ranges = driver.robot.measure().ranges
    for index, distance in ((0, 2.7 - joints[1]), (RING.count // 4, 2.5 + joints[0])):
        angle = joints[2] - math.pi / 2
        assert ranges[index] == pytest.approx(distance / math.cos(angle), abs=0.01)


def test_an_object_nearby_is_seen_and_the_robot_itself_is_not(driver: Driver) -> None:
    barrel = driver.place("barrel")
    bearing = round(math.atan2(barrel[1], barrel[0]) / RING.angle_increment) % RING.count
    ranges = driver.robot.measure().ranges
    assert ranges[bearing] == pytest.approx(math.hypot(barrel[0], barrel[1]) - 0.17, abs=0.05)
    assert min(ranges) > RING.range_min + 0.2


def test_where_nothing_is_within_reach_the_range_is_the_largest(driver: Driver) -> None:
    driver.data.qpos[0] = 20.0  # outside the room
    driver.run(0.01)
    assert driver.robot.measure().ranges[0] == RING.range_max
