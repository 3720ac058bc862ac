"""What the caller wants of the robot now, and the commands that say so. No I/O."""

from collections.abc import Sequence
from enum import Enum

from lockstep.protocol.messages import Command

__all__ = ["Intention", "Want"]


class Want(Enum):
    """The values that the next command is to carry."""

    NOTHING = 0
    NEUTRAL = 1
    VALUES = 2


class Intention:
    """The values that are wanted now; a command in flight repeats with them.

    Attributes:
        want: what the next command is to carry
        ticket: of the newest values
        action: id of the moving action that every command lets go on; "": none
    """

    def __init__(self, neutral: Sequence[float | None]) -> None:
        """`neutral`: one value per axis, which moves nothing."""
        self.want = Want.NOTHING
        self.ticket = 0
        self.action = ""
        self._neutral = list(neutral)
        self._values = list(neutral)
        self._speed = 1.0  # share of the goal axes' largest speed that goes with the values

    def set(self, values: Sequence[float | None] | None, speed: float = 1.0) -> int:
        """Want these values next; None: the neutral ones. Returns their ticket."""
        self._values, self._speed = list(self._neutral if values is None else values), speed
        self.want = Want.VALUES
        self.ticket += 1
        return self.ticket

    def forget(self, want: Want) -> None:
        """Forget the values: those are neutral from now on, and the next command carries `want`."""
        self._values, self._speed = list(self._neutral), 1.0
        self.want = want

    @property
    def is_neutral(self) -> bool:
        """True if the newest values move nothing."""
        return self._values == self._neutral

    @property
    def lets_go(self) -> bool:
        """True if the next command moves nothing and renews no action."""
        return not self.action and (self.want is Want.NEUTRAL or self._values == self._neutral)

    def command(self, event: int, issue: int, nonce: int, want: Want) -> Command:
        """Return the command for an event, with neutral values unless `want` is VALUES."""
        is_neutral = want is not Want.VALUES
        return Command(
            event=event,
            issue=issue,
            values=list(self._neutral if is_neutral else self._values),
            nonce=nonce,
            action=self.action,
            speed=1.0 if is_neutral else self._speed,
        )

    def moves_nothing(self, command: Command) -> bool:
        """Return whether the command is neutral: each rate axis at rest, and no goal."""
        return list(command.values) == self._neutral
