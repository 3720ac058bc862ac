"""Actions of a robot adapter: the part that its author writes (docs/robot-link.md, "Actions")."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

__all__ = ["ActionDone", "ActionFailed", "ActionNotPossible", "ActionRun", "ActionStep"]


class ActionNotPossible(Exception):
    """Raised by `Robot.begin_action` when the robot cannot begin the action now. The text tells a person why."""


class ActionFailed(Exception):
    """Raised by `ActionRun.step` when the action did not work. The robot is at rest, or comes to rest by itself."""


class ActionStep(NamedTuple):
    """How far an action is."""

    progress: float = 0.0  # from 0 to 1
    text: str = ""  # what it does now; its result when it is done
    # Values for the axes, as those of a command: the bridge clamps them, keeps slew, limits and geofences, and brings
    # them to rest when the action ends. None in place of a value: that goal axis stays where it is; `reach` does not
    # bound an action. None in place of all: the robot moves in its own way, or not at all.
    values: Sequence[float | None] | None = None
    done: bool = False


class ActionRun(ABC):
    """One run of an action. Both methods are called from the bridge's event loop and must return at once.

    With `waits` the run moves nothing but the axes, by the values of its steps, and each step begins from where the
    robot is. Then the bridge does not cancel it when it was not renewed for `hold`: the axes are at rest, `step` is not
    called, and the next renewal lets it go on. That takes 2 s at most. Any other run is cancelled after `hold`.
    """

    waits: bool = False

    @abstractmethod
    def step(self) -> ActionStep:
        """Do the next part of the action. Called once a tick, before `apply`; not while it waits to be renewed.

        Raises:
            ActionFailed: the action did not work.
        """

    @abstractmethod
    def cancel(self) -> None:
        """Bring everything that this action moves to rest, now. No `step` follows."""


class ActionDone(ActionRun):
    """The run of an action that was already done when it began."""

    def __init__(self, text: str = "") -> None:
        self._text = text

    def step(self) -> ActionStep:
        return ActionStep(progress=1.0, text=self._text, done=True)

    def cancel(self) -> None:
        pass
