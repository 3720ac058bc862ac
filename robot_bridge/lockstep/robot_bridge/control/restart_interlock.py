"""Refuses motion after a restart until a neutral command, and while the robot warns before it moves. No I/O, no clock.

docs/robot-link.md, "Before the first motion", has the rules.
"""

import math
from typing import Literal

from lockstep.protocol.description import StartWarning
from lockstep.robot_bridge.control.issue_schedule import IssueSchedule

__all__ = ["RestartInterlock"]

# s without a command that executed or was refused because the robot warns; then it has to warn again.
SILENCE = 2.0


class RestartInterlock:
    """Decides whether moving commands may execute.

    Call `require` after everything that must not let the robot move on without a new decision of its operator. The
    caller brings the axes to rest.
    """

    def __init__(self, schedule: IssueSchedule, warning: StartWarning | None = None) -> None:
        """`schedule`: of the feedback, which tells that a neutral command is needed."""
        self._schedule = schedule
        self._warning = warning
        self._needed = True
        self._spell = 1  # counts the causes: a neutral command that was decided before a cause does not clear it
        self._warns_until = -math.inf
        # s, when a command executed, or was refused because the robot warns; infinite while a neutral one is needed.
        self._heard_at = math.inf

    @property
    def needed(self) -> bool:
        """True while no moving command executes before a neutral one."""
        return self._needed

    @property
    def spell(self) -> int:
        """The number to keep with each issue: a neutral command counts if it answers an issue of the present spell."""
        return self._spell

    def require(self) -> None:
        """Refuse moving commands from now on until a neutral one."""
        self._needed = True
        self._spell += 1
        self._warns_until = -math.inf
        self._heard_at = math.inf
        self._schedule.want()

    def look(self, now: float) -> None:
        """Require a neutral command after `SILENCE`; call before any decision and once a tick."""
        if self._warning is not None and now - self._heard_at > SILENCE:
            self.require()

    def judge_moving(self, issued: float, now: float) -> Literal["not_neutral", "warning"] | None:
        """Return why a moving command that arrived now may not execute; None if it may.

        `issued`: s, when the feedback was issued that it answers. A command during the warning ends the silence then,
        and not when one of its copies comes: a person who holds the stick all the while drives when the warning ends.
        """
        if self._needed:
            return "not_neutral"
        if now >= self._warns_until:
            return None
        self._heard_at = max(self._heard_at, issued)
        return "warning"

    def executed(self, *, moving: bool, spell: int, now: float) -> None:
        """Note that a command executed as the answer to an issue of this spell."""
        if self._needed and not moving and spell == self._spell:
            self._needed = False
            if self._warning is not None:
                self._warns_until = now + self._warning.seconds
        if not self._needed:
            self._heard_at = now

    def warns(self, now: float) -> float:
        """Return the seconds for which the robot still warns; 0 if it does not."""
        return max(0.0, self._warns_until - now)
