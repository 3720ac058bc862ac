"""The axes of a robot while an action drives them itself."""

from collections.abc import Sequence

from lockstep.robot_bridge.control.goals.command_values import CommandValues
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper

__all__ = ["ActionAxes"]


class ActionAxes:
    """Call `drive` with each step's values, and `rest` when the action that moves the robot has ended."""

    def __init__(self, shaper: AxisShaper, values: CommandValues) -> None:
        """`values`: judges values by the robot's axes."""
        self._shaper = shaper
        self._values = values
        self._drives = False  # the moving action drives the axes itself

    def drive(self, values: Sequence[float | None], now: float) -> None:
        """Aim for values, which hold as those of a command at `now` do.

        Raises:
            ValueError: they do not fit the axes.
        """
        if (misfit := self._values.misfit(values)) is not None:
            raise ValueError(f"an action drives axes with values that do not fit them: {' '.join(misfit)}")
        self._shaper.drive(values, now)
        self._drives = True

    def rest(self) -> None:
        """Bring the axes to rest if the action has driven them."""
        if self._drives:
            self._drives = False
            self._shaper.rest()
