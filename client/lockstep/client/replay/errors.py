"""Errors of replaying.

ConsoleError
└── ReplayError
    ├── ReplayUnfit         the robot has no such axis, or the values are not its own (caller)
    ├── ReplayTooFar        the robot is too far from where the episode begins
    └── ReplayDeviated      the robot does not follow: something is in its way
"""

from lockstep.client.errors import ConsoleError

__all__ = ["ReplayDeviated", "ReplayError", "ReplayTooFar", "ReplayUnfit"]


class ReplayError(ConsoleError):
    """Base of the errors of replaying."""


class ReplayUnfit(ReplayError):
    """The recording does not fit this robot."""


class ReplayTooFar(ReplayError):
    """The robot is further from where the episode begins than it may be. Nothing has moved.

    Attributes:
        axis: the axis' name
        measured, start: in the axis' unit
    """

    def __init__(self, axis: str, unit: str, measured: float, start: float, most: float) -> None:
        super().__init__(
            f"{axis} is at {measured:.3g} {unit}, and the episode begins at {start:.3g} {unit}: "
            f"further than {most:.3g} {unit}"
        )
        self.axis, self.measured, self.start = axis, measured, start


class ReplayDeviated(ReplayError):
    """The robot is further from the recorded state than it may be, and was brought to rest.

    Attributes:
        axis: the axis' name
        measured, recorded: in the axis' unit
    """

    def __init__(self, axis: str, unit: str, measured: float, recorded: float) -> None:
        super().__init__(
            f"{axis} is at {measured:.3g} {unit} where {recorded:.3g} {unit} was recorded: replay has ended"
        )
        self.axis, self.measured, self.recorded = axis, measured, recorded
