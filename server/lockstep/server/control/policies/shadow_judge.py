"""Judges what shadow policies want: commands that they would send, and that never reach the robot. No I/O, no clock.

A shadow names the feedback that it answers, as a command does. Of each peer the newest one for the next event counts,
and it is judged once, when that event has been executed:

| condition | judgement |
|---|---|
| it came after the event was executed, or answers an issue that the console does not know | late |
| its nonce is not that of this issue | unseen |
| not one value per axis | wrong_size |
| a value is infinite, or the null of a rate axis | not_a_number |
| a value is outside of its axis' range | out_of_limits |
| else | in_time |

What is in time or out of limits is compared with the command that was executed: the difference is that of the axis that
is furthest apart, as a share of the axis' range. A goal axis that is to stay is compared by its applied goal.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.protocol.console import Shadow, ShadowJudgement
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, RefusalReason
from lockstep.protocol.serial import event_after, is_newer
from lockstep.server.control.known_issues import KnownIssues

__all__ = ["MAX_SHADOWS", "JudgedShadow", "ShadowJudge"]

MAX_SHADOWS = 8  # peers at once whose shadows are kept


class JudgedShadow(NamedTuple):
    peer: str
    shadow: Shadow
    judgement: ShadowJudgement
    difference: float | None = None  # 0 to 1 and, out of limits, more; None: not compared


class ShadowJudge:
    """Call `link_up`, `feedback` with each accepted feedback, `take` with each shadow, and `gone` for a peer's end.

    Of all peers MAX_SHADOWS are judged at once; further ones are refused until one of those is gone.
    """

    def __init__(self) -> None:
        self._description: RobotDescription | None = None
        self._feedback: Feedback | None = None
        self._issues = KnownIssues()
        self._waiting: dict[str, tuple[Shadow, ShadowJudgement]] = {}  # newest of each peer, for the next event
        self._judged: dict[str, int] = {}  # peer -> the newest event for which a shadow of it was judged

    def robot_link_up(self, description: RobotDescription) -> None:
        self._description = description

    def epoch_ends(self) -> None:
        """Forget this epoch: its event references mean nothing in the next."""
        self._feedback = None
        self._issues.clear()
        self._waiting.clear()
        self._judged.clear()

    def gone(self, peer: str) -> None:
        self._waiting.pop(peer, None)
        self._judged.pop(peer, None)

    def take(self, peer: str, shadow: Shadow) -> JudgedShadow | RefusalReason | None:
        """Keep a shadow until its event is executed; return its judgement if it is late, or why it is refused."""
        feedback = self._feedback
        if feedback is None or self._description is None:
            return "link_down"
        if peer not in self._judged and len(self._judged) >= MAX_SHADOWS:
            return "too_often"
        if not is_newer(shadow.event, feedback.event):
            return self._late(peer, shadow, feedback.event)
        if shadow.event != event_after(feedback.event):
            return "out_of_order"
        self._judged.setdefault(peer, feedback.event)
        self._waiting[peer] = shadow, self._judgement(shadow, self._description)
        return None

    def _late(self, peer: str, shadow: Shadow, current: int) -> JudgedShadow | None:
        """Judge a late one: one for each event that is executed, however many come."""
        if peer in self._judged and not is_newer(shadow.event, self._judged[peer]):
            return None
        self._judged[peer] = current
        return JudgedShadow(peer, shadow, "late")

    def feedback(self, feedback: Feedback, executed: Command | None) -> list[JudgedShadow]:
        """Take a feedback, and the command that became its event; return what is judged by it."""
        before, self._feedback = self._feedback, feedback
        self._issues.add(feedback)
        if before is None or before.event == feedback.event:
            return []
        waiting, self._waiting = self._waiting, {}
        self._judged |= dict.fromkeys(waiting, feedback.event)
        return [
            JudgedShadow(peer, shadow, judgement, self._difference(shadow, judgement, executed, before))
            for peer, (shadow, judgement) in waiting.items()
            if shadow.event == feedback.event
        ]

    def _judgement(self, shadow: Shadow, description: RobotDescription) -> ShadowJudgement:
        nonce, axes = self._issues.nonce(shadow.issue), description.axes
        if nonce is None:
            return "late"
        if nonce != shadow.nonce:
            return "unseen"
        if len(shadow.values) != len(axes):
            return "wrong_size"
        if not all(map(_is_number, shadow.values, axes)):
            return "not_a_number"
        return "in_time" if all(map(_is_inside, shadow.values, axes)) else "out_of_limits"

    def _difference(
        self, shadow: Shadow, judgement: ShadowJudgement, executed: Command | None, before: Feedback
    ) -> float | None:
        if executed is None or self._description is None or executed.event != shadow.event:
            return None
        if judgement not in ("in_time", "out_of_limits"):
            return None
        axes = self._description.axes
        goals: Sequence[float | None] = before.goals or [None] * len(axes)
        apart = [
            _apart(axis, wanted, done, goal)
            for axis, wanted, done, goal in zip(axes, shadow.values, executed.values, goals, strict=False)
        ]
        return round(max(apart, default=0.0), 4)


def _is_number(value: float | None, axis: Axis) -> bool:
    return axis.kind == "goal" if value is None else math.isfinite(value)


def _is_inside(value: float | None, axis: Axis) -> bool:
    return value is None or axis.minimum <= value <= axis.maximum


def _apart(axis: Axis, wanted: float | None, done: float | None, goal: float | None) -> float:
    """Return how far two values of an axis are apart; None stays at the applied `goal`."""
    one, other = (goal if value is None else value for value in (wanted, done))
    if one is None or other is None:
        return 0.0 if one is other else 1.0
    way = one - other if axis.wrap is None else math.remainder(one - other, axis.wrap)
    return abs(way) / ((axis.wrap or axis.maximum - axis.minimum) or 1.0)
