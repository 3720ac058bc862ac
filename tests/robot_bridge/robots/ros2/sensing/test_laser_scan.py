"""Many rays become few sectors."""

import math
from dataclasses import dataclass, field
from random import Random

import pytest

from lockstep.robot_bridge.robots.ros2.sensing.laser_scan import BadScan, Sectors


@dataclass
class Scan:
    ranges: list[float]
    angle_min: float = -math.pi
    angle_increment: float = math.tau / 360
    range_min: float = 0.1
    range_max: float = 10.0
    intensities: list[float] = field(default_factory=list)


def sector(angle: float, count: int = 36) -> int:
    return round((angle + math.pi) * count / math.tau) % count


def test_each_sector_shows_the_nearest_thing_in_it() -> None:
    ranges = [5.0] * 360
    ranges[180] = 2.0  # straight ahead
    ranges[270] = 3.0  # left
    gathered = Sectors(36, 0.05, 8.0).gather(Scan(ranges))
    assert gathered[sector(0.0)] == 2.0
    assert gathered[sector(math.pi / 2)] == 3.0
    assert set(gathered) == {2.0, 3.0, 5.0}


def test_where_nothing_was_seen_the_farthest_is_shown() -> None:
    gathered = Sectors(36, 0.05, 8.0).gather(Scan([math.inf, math.nan, -1.0, 0.0, 9.0, 0.04] * 60))
    assert gathered == [8.0] * 36


def test_a_scanner_that_looks_only_ahead_leaves_the_rest_free() -> None:
    gathered = Sectors(36, 0.05, 8.0).gather(Scan([1.0] * 91, angle_min=-math.pi / 4, angle_increment=math.pi / 180))
    assert gathered[sector(0.0)] == 1.0
    assert gathered[sector(math.pi)] == 8.0


def test_a_scanner_may_be_mounted_turned() -> None:
    ranges = [5.0] * 360
    ranges[180] = 2.0
    gathered = Sectors(36, 0.05, 8.0, yaw=math.pi).gather(Scan(ranges))
    assert gathered[sector(math.pi)] == 2.0


def test_a_scan_may_run_clockwise() -> None:
    ranges = [5.0] * 360
    ranges[90] = 2.0
    gathered = Sectors(36, 0.05, 8.0).gather(Scan(ranges, angle_min=math.pi, angle_increment=-math.tau / 360))
    assert gathered[sector(math.pi / 2)] == 2.0


@pytest.mark.parametrize(
    "scan",
    [
        Scan([]),
        Scan([1.0] * 100_001),
        Scan([1.0], angle_increment=0.0),
        Scan([1.0], angle_increment=math.nan),
        Scan([1.0], angle_min=math.inf),
    ],
    ids=["empty", "too-many", "no-step", "step-nan", "angle-inf"],
)
def test_a_scan_that_contradicts_itself_is_refused(scan: Scan) -> None:
    with pytest.raises(BadScan):
        Sectors(36, 0.05, 8.0).gather(scan)


def test_whatever_a_scan_says_the_sectors_are_numbers_within_bounds() -> None:
    random = Random(1)
    odd = [math.nan, math.inf, -math.inf, 0.0, -5.0, 1e300, 3.0]
    for _ in range(200):
        scan = Scan(
            [random.choice(odd) for _ in range(random.randrange(1, 50))],
            angle_min=random.uniform(-1e6, 1e6),
            angle_increment=random.choice([-1e3, 1e-9, 0.1]),
            range_min=random.choice(odd),
            range_max=random.choice(odd),
        )
        assert all(0.05 <= distance <= 8.0 for distance in Sectors(12, 0.05, 8.0).gather(scan))


def test_a_scanner_in_front_of_the_middle_sees_from_the_middle() -> None:
    ranges = [math.inf] * 360
    ranges[180] = 2.0  # straight ahead of the scanner, which looks to the left
    gathered = Sectors(36, 0.05, 8.0).gather(Scan(ranges), mount=(0.5, 0.0, math.pi / 2))
    assert gathered[sector(math.atan2(2.0, 0.5))] == pytest.approx(math.hypot(2.0, 0.5))
    assert sum(distance < 8.0 for distance in gathered) == 1
