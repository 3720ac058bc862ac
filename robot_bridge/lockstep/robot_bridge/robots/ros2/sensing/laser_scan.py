"""Reduces a sensor_msgs/LaserScan to the few rays that a console draws. No I/O."""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

__all__ = ["BadScan", "Scan", "Sectors"]

MAX_RAYS = 100_000


class BadScan(ValueError):
    """A scan that contradicts itself; the text names the fault, without figures, for counting."""


class Scan(Protocol):
    """The fields of sensor_msgs/LaserScan that matter."""

    @property
    def angle_min(self) -> float: ...
    @property
    def angle_increment(self) -> float: ...
    @property
    def range_min(self) -> float: ...
    @property
    def range_max(self) -> float: ...
    @property
    def ranges(self) -> Sequence[float]: ...


class Sectors:
    """`count` sectors all around, the first centred on -pi; each shows the nearest distance within it."""

    def __init__(self, count: int, range_min: float, range_max: float, yaw: float = 0.0) -> None:
        """`yaw`: rad, of the scanner's frame in the body's."""
        self._count = count
        self._range_min = range_min
        self._range_max = range_max
        self._yaw = yaw

    def gather(self, scan: Scan, mount: tuple[float, float, float] | None = None) -> list[float]:
        """Return the distance of each sector, m.

        `mount`: pose of the scanner in the body, m and rad; None: in its middle, with the yaw of the settings.

        Raises:
            BadScan: the scan contradicts itself.
        """
        ranges: npt.NDArray[np.float64] = np.asarray(scan.ranges, np.float64)
        if not 0 < ranges.size <= MAX_RAYS:
            raise BadScan("scan without rays, or with far too many")
        if not (math.isfinite(scan.angle_min) and math.isfinite(scan.angle_increment)) or scan.angle_increment == 0:
            raise BadScan("scan with invalid angles")
        x, y, yaw = mount or (0.0, 0.0, self._yaw)
        angles = scan.angle_min + yaw + scan.angle_increment * np.arange(ranges.size)
        # Beyond its own limits a scanner says nothing (REP 117: NaN is wrong, infinite is free).
        seen = (ranges >= max(scan.range_min, self._range_min)) & (ranges <= min(scan.range_max, self._range_max))
        angles, ranges = angles[seen], ranges[seen]
        if x or y:  # as seen from the middle of the body
            along, across = x + ranges * np.cos(angles), y + ranges * np.sin(angles)
            angles, ranges = np.arctan2(across, along), np.minimum(np.hypot(along, across), self._range_max)
        sectors = np.rint((angles + math.pi) * (self._count / math.tau)).astype(np.int64) % self._count
        nearest = np.full(self._count, self._range_max)
        np.minimum.at(nearest, sectors, ranges)
        return [float(distance) for distance in nearest]
