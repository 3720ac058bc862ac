"""Keeps a robot from moving on without its operator: a neutral command has to come first, and the robot may warn before
it moves. No I/O, no clock (docs/robot-link.md, "Before the first motion").
"""

import math
from typing import Literal

from lockstep.protocol.description import StartWarning

__all__ = ["RestartInterlock"]

SILENCE = 2.0  # s without an executed command after which a robot that warns has to warn again


class RestartInterlock:
    """Call `require` for everything after which motion has to be a decision of its own."""

    def __init__(self, warning: StartWarning | None = None) -> None:
        self._warning = warning
        self._needed = True
        self._spell = 1  # counts the causes: a neutral command that was decided before a cause does not clear it
        self._warns_until = -math.inf
        self._executed_at = math.inf  # s, when a command executed last; infinite while a neutral one is needed

    @property
    def needed(self) -> bool:
        """No moving command executes before a neutral one."""
        return self._needed

    @property
    def spell(self) -> int:
        """Kept with each issue: a neutral command counts when it answers an issue of this spell."""
        return self._spell

    def require(self) -> None:
        self._needed = True
        self._spell += 1
        self._warns_until = -math.inf
        self._executed_at = math.inf

    def look(self, now: float) -> bool:
        """Before anything is decided, and once a tick. True: from now on a neutral command is needed."""
        if self._warning is None or now - self._executed_at <= SILENCE:
            return False
        self.require()
        return True

    def refuses(self, now: float) -> Literal["not_neutral", "warning"] | None:
        """Why a moving command may not execute; None when it may."""
        if self._needed:
            return "not_neutral"
        return "warning" if now < self._warns_until else None

    def executed(self, *, moving: bool, spell: int, now: float) -> None:
        """A command executed, as the answer to an issue of this spell."""
        if self._needed and not moving and spell == self._spell:
            self._needed = False
            if self._warning is not None:
                self._warns_until = now + self._warning.seconds
        if not self._needed:
            self._executed_at = now

    def warns(self, now: float) -> float:
        """s that the robot still warns; 0 when it does not."""
        return max(0.0, self._warns_until - now)
