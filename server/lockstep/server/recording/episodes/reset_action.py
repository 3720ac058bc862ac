"""The action of the robot that is run between episodes (docs/episodes.md, "The reset").

An action that moves the robot lives only while armed events of the seat's holder renew it. So the console does not
begin one: whoever drives does, and the console waits for its end.
"""

import secrets
from collections.abc import Callable
from typing import Protocol

from lockstep.protocol.actions import Act, ActionUpdate
from lockstep.protocol.description import RobotDescription
from lockstep.server.event_clock import EventClock
from lockstep.server.session_events import ActionUpdated

__all__ = ["ResetAction"]


class ActingRobot(Protocol):
    """The part of the connection to the robot that is needed here."""

    @property
    def description(self) -> RobotDescription | None: ...


class ResetAction:
    """`begin` it, and look at `ended` until that is not None."""

    def __init__(self, name: str, robot: ActingRobot, clock: EventClock, act: Callable[[Act], bool]) -> None:
        """`name`: of the action, "" for none; `act`: passes a request for an action that moves nothing on."""
        self.name = name
        self._robot = robot
        self._clock = clock
        self._act = act
        self._id: str | None = None  # of the request; "": of whoever asks for it next
        self._ended: str | None = None

    @property
    def is_wanted(self) -> bool:
        return bool(self.name)

    def begin(self) -> None:
        """Ask the robot for it, or wait until the person who drives does."""
        self._ended = None
        description, feedback = self._robot.description, self._clock.feedback
        actions = () if description is None else description.actions
        action = next((each for each in actions if each.name == self.name), None)
        if action is None or feedback is None:
            self._ended = f"the robot has no action {self.name!r}"
        elif action.moves:
            self._id = ""
        else:
            self._id = secrets.token_hex(16)
            if not self._act(Act(id=self._id, name=self.name, nonce=feedback.nonce, by="episodes")):
                self._ended = "there is no link to the robot"

    def ended(self) -> str | None:
        """Return why it failed, "" if it did not; None: it has not ended."""
        return self._ended

    def updated(self, event: ActionUpdated) -> None:
        update = event.update
        if update.name != self.name or self._ended is not None or self._id is None:
            return
        if self._id == "" and update.state == "running":
            self._id = update.id
        if update.id == self._id and update.state not in ("running",):
            self._ended = _failure(update)


def _failure(update: ActionUpdate) -> str:
    return "" if update.state == "done" else f"{update.state} {update.text or update.reason}".strip()
