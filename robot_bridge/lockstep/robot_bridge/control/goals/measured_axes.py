"""Measures the axes outside of a tick, where an adapter that raises must not end the link whose message asked."""

import math
from collections.abc import Sequence

from lockstep.robot_bridge.robots.base import Robot

__all__ = ["MeasuredAxes"]


class MeasuredAxes:
    """Returns the measured value of each axis when it is called; NaN for all if the adapter raised.

    Call `look` in every tick.
    """

    def __init__(self, robot: Robot, axes: int) -> None:
        self._robot = robot
        self._axes = axes
        self._error: BaseException | None = None

    def __call__(self) -> Sequence[float]:
        try:
            places = self._robot.measured_axes()
            if len(places) != self._axes:
                raise ValueError(f"measured_axes returned {len(places)} values for {self._axes} axes")
        except BaseException as error:  # an adapter may raise one that ends the loop or cancels the task
            self._error = error
            return [math.nan] * self._axes
        return places

    def look(self) -> None:
        """Raise what the adapter raised.

        Raises:
            BaseException: the adapter's.
        """
        if self._error is not None:
            raise self._error
