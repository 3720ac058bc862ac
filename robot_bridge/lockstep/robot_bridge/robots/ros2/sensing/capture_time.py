"""Computes the time of capture of a picture that has just arrived, on the bridge's own clock. No I/O, no clock.

The result may be too early, never too late: a picture that is stamped too late would pass for newer than it is.
"""

from typing import Literal

__all__ = ["ClockMismatch", "captured_at"]

OLDEST = 10.0  # s; a picture that seems older has another clock


class ClockMismatch(ValueError):
    """A header stamp that this machine's clock cannot have given; the text names the fault, for counting."""


def captured_at(
    source: Literal["header", "arrival"], *, arrived: float, arrived_ros: int, header: int, latency: float
) -> float:
    """Return the time of capture, s.

    `arrived` (s, monotonic) and `arrived_ros` (ns, the ROS clock) are the same instant.

    Raises:
        ClockMismatch: the header's stamp is missing, in the future or far in the past.
    """
    if source == "arrival":
        return arrived - latency
    if header == 0:
        raise ClockMismatch("picture without a header stamp (set captured: arrival)")
    age = (arrived_ros - header) / 1e9
    if age < 0:
        raise ClockMismatch("header stamp from the future (are the clocks synchronised?)")
    if age > OLDEST:
        raise ClockMismatch("header stamp far in the past (are the clocks synchronised?)")
    return arrived - age - latency
