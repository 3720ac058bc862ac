"""What the console needs of the 3D scene, and what stands in for one that is switched off."""

from typing import Protocol

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Feedback

__all__ = ["SceneFeed", "NoSceneFeed"]


class SceneFeed(Protocol):
    """None of these may wait."""

    def configure(self, description: RobotDescription) -> None: ...
    def command(self, command: Command) -> None: ...
    def feedback(self, feedback: Feedback) -> None: ...


class NoSceneFeed:
    """Looks at nothing."""

    def configure(self, description: RobotDescription) -> None: ...
    def command(self, command: Command) -> None: ...
    def feedback(self, feedback: Feedback) -> None: ...
