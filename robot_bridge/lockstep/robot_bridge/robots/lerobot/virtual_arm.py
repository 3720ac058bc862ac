"""An arm that is nowhere: a console drives it, and what it is told is what a robot of LeRobot gets as its action."""

from collections.abc import Sequence

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.robots.base import Measurement, Robot

__all__ = ["VirtualArm"]


class VirtualArm(Robot):
    """Is where it is told to be, at once: the bridge has bounded the way there already."""

    tick_seconds = 0.01

    def __init__(self, description: RobotDescription, places: Sequence[float]) -> None:
        """`places`: where the axes are at first, in the description's order."""
        self._description = description
        self._places = list(places)
        self._is_stopped = False

    @property
    def action(self) -> dict[str, float]:
        """The applied value of each axis."""
        return dict(zip((axis.name for axis in self._description.axes), self._places, strict=True))

    def describe(self) -> RobotDescription:
        return self._description

    def apply(self, values: Sequence[float]) -> None:
        if not self._is_stopped:
            self._places = list(values)

    def measured_axes(self) -> Sequence[float]:
        return list(self._places)

    def measure(self) -> Measurement:
        return Measurement(list(self._places), [], [], [], at_rest=True, faults=[])

    def stop(self) -> None:
        self._is_stopped = True

    def reset(self) -> None:
        self._is_stopped = False
