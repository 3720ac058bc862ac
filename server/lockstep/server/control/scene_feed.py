"""The console's interface to the 3D scene, and a substitute for a scene that is switched off."""

from typing import Protocol

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Feedback

__all__ = ["SceneFeed", "NoSceneFeed"]


class SceneFeed(Protocol):
    """The part of the 3D scene that the console uses. No method may block."""

    def configure(self, description: RobotDescription) -> None: ...
    def command(self, command: Command) -> None: ...
    def feedback(self, feedback: Feedback) -> None: ...


class NoSceneFeed:
    """Ignores everything, in place of a scene that is switched off."""

    def configure(self, description: RobotDescription) -> None: ...
    def command(self, command: Command) -> None: ...
    def feedback(self, feedback: Feedback) -> None: ...
