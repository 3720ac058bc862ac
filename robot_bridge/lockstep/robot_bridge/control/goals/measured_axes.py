"""Measures the axes outside of a tick, where an adapter that raises must not end the link whose message asked."""

import math
from collections.abc import Sequence

from lockstep.robot_bridge.robots.base import Robot

__all__ = ["MeasuredAxes"]

LATELY = 1.0  # s after a command asked, in which the axes are measured ahead of the next one


class MeasuredAxes:
    """Returns the measured value of each axis when it is called; NaN for all if the adapter raised.

    Call `look` in every tick, and `measure_ahead` when there is time after one. It asks the adapter once between two
    ticks at most: a link may send thousands of commands a second whose goals are refused, and a slow adapter that was
    asked for each would hold up the ticks.
    """

    def __init__(self, robot: Robot, axes: int) -> None:
        self._robot = robot
        self._axes = axes
        self._error: BaseException | None = None
        self._places: Sequence[float] | None = None  # measured since the last tick
        self._lately = int(LATELY / robot.tick_seconds)  # ticks
        self._unasked = self._lately + 1  # ticks since a command asked

    def __call__(self) -> Sequence[float]:
        self._unasked = 0
        if self._places is None:
            self._places = self._measure()
        return self._places

    def measure_ahead(self) -> bool:
        """Ask the adapter now if commands have asked lately: the next one need not. Return whether it was asked."""
        if self._places is not None or self._unasked > self._lately:
            return False
        self._places = self._measure()
        return True

    def _measure(self) -> Sequence[float]:
        try:
            places = self._robot.measured_axes()
            if len(places) != self._axes:
                raise ValueError(f"measured_axes returned {len(places)} values for {self._axes} axes")
        except BaseException as error:  # an adapter may raise one that ends the loop or cancels the task
            self._error = error
            return [math.nan] * self._axes
        return places

    def look(self) -> None:
        """Let the adapter be asked anew. Raise what it raised.

        Raises:
            BaseException: the adapter's.
        """
        self._places = None
        self._unasked += 1
        if self._error is not None:
            raise self._error
