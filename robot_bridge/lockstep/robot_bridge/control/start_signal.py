"""Switches the light or horn that warns before the first motion. No I/O."""

from collections.abc import Sequence

from lockstep.protocol.description import RobotDescription

__all__ = ["StartSignal"]


class StartSignal:
    """Replaces the value of the signal's axis."""

    def __init__(self, description: RobotDescription) -> None:
        """`description`: one that was checked."""
        self._warning = description.start_warning
        self._index = [axis.name for axis in description.axes].index(self._warning.axis) if self._warning else -1

    def on(self, values: Sequence[float]) -> list[float]:
        """Return the values with the signal on; unchanged for a robot that does not warn."""
        if self._warning is None:
            return list(values)
        return [self._warning.value if index == self._index else value for index, value in enumerate(values)]
