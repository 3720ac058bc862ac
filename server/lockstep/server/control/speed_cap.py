"""The speed cap, which limits the speed by the delay of the operator's picture. No I/O, no clock.

v <= v_max * min(1, 0.2 s / delay), the rule of the German ordinance on remote driving (StVFernLV). It caps the values
of rate axes and the speed of goal axes. The delay is the longer of the one that the seat's holder reports (command to
picture, on its own clock) and the one that the console measures, from a feedback's departure to the command that
answers it. Nobody can answer before the feedback was there, because a command names its nonce, so neither a report nor
a guess can make the path look shorter than it is.

In doubt the robot is slow: a holder that reports no delay, or has not reported for a while, counts as `UNKNOWN_DELAY`
late.

| mode | the cap holds |
|---|---|
| on | always |
| operator | while the holder's reports ask for it |
| off | never |
"""

from collections import deque
from typing import Literal, NamedTuple

from lockstep.protocol.console import Report, SpeedCapMode, SpeedCapState
from lockstep.protocol.description import Axis
from lockstep.protocol.messages import Command, Feedback

__all__ = ["SpeedCap", "within_share"]

FREE_DELAY = 0.2  # s, up to which nothing is capped
UNKNOWN_DELAY = 1.0  # s that an unknown delay counts as
STALE = 2.0  # s after which a report no longer counts; clients report twice a second
WINDOW = 2.0  # s over which the shortest answer counts: an operator at rest answers late
REMEMBERED = 256  # departures of feedback, and answers
TOLD_STEP = 0.05  # smallest change of the share that is told

Why = Literal["", "delay", "unknown"]


class Answer(NamedTuple):
    at: float  # s
    delay: float  # s after the feedback left


class SpeedCap:
    """Measures the delay by `fed_back`, `reported` and `answered`; `share` is the usable part of an axis' speed."""

    def __init__(self, mode: SpeedCapMode) -> None:
        self._mode: SpeedCapMode = mode
        self._left_at: dict[tuple[int, int, int], float] = {}  # (event, issue, nonce) -> s
        self._holder = ""  # peer of the report and the answers below
        self._report = Report()
        self._reported_at = float("-inf")
        self._answers: deque[Answer] = deque(maxlen=REMEMBERED)
        self._told = SpeedCapState(mode=mode)

    def forget(self) -> None:
        """Forget all feedback, for a new epoch: its events have nothing to do with those before."""
        self._left_at.clear()

    def fed_back(self, feedback: Feedback, now: float) -> None:
        """Called when a feedback leaves for the operators."""
        self._left_at[feedback.event, feedback.issue, feedback.nonce] = now
        if len(self._left_at) > REMEMBERED:
            del self._left_at[next(iter(self._left_at))]

    def reported(self, holder: str, report: Report, now: float) -> None:
        """Called with each report of the seat's holder."""
        self._about(holder)
        self._report, self._reported_at = report, now

    def answered(self, holder: str, event: int, command: Command, now: float) -> None:
        """Called when a command of the seat's holder comes as the answer to feedback `event`."""
        self._about(holder)
        left_at = self._left_at.get((event, command.issue, command.nonce))
        if left_at is not None:
            self._answers.append(Answer(now, now - left_at))

    def holds(self) -> bool:
        """True if the cap is in force."""
        return self._mode == "on" or (self._mode == "operator" and self._report.speed_cap)

    def delay(self, now: float) -> float | None:
        """Return the delay in s; None when it is not known."""
        reported = self._report.picture_delay_ms
        if reported is None or not reported >= 0 or now - self._reported_at > STALE:
            return None
        answers = [answer.delay for answer in self._answers if now - answer.at <= WINDOW]
        return max(reported / 1000, min(answers, default=0.0))

    def share(self, now: float) -> float:
        """Return the usable part of an axis' speed, 0 to 1."""
        return self._share(self.delay(now)) if self.holds() else 1.0

    def state(self, now: float) -> SpeedCapState:
        """Return the state to tell everyone. Before the holder arms it names no delay."""
        if not self.holds() or not self._report.armed:
            return SpeedCapState(mode=self._mode, holds=self.holds())
        delay = self.delay(now)
        share = self._share(delay)
        why: Why = "unknown" if delay is None else "delay" if share < 1.0 else ""
        delay_ms = None if delay is None else round(delay * 1000)
        return SpeedCapState(mode=self._mode, holds=True, share=round(share, 2), delay_ms=delay_ms, why=why)

    def news(self, now: float) -> SpeedCapState | None:
        """Return the state if it is worth telling again, else None."""
        state, told = self.state(now), self._told
        same = (state.holds, state.why) == (told.holds, told.why) and abs(state.share - told.share) < TOLD_STEP
        if same:
            return None
        self._told = state
        return state

    def _share(self, delay: float | None) -> float:
        return min(1.0, FREE_DELAY / max(UNKNOWN_DELAY if delay is None else delay, 1e-9))

    def _about(self, holder: str) -> None:
        """Forget the reports and answers of another holder: they do not count for this one."""
        if holder != self._holder:
            self._holder = holder
            self._report, self._reported_at = Report(), float("-inf")
            self._answers.clear()


def within_share(axis: Axis, value: float, share: float) -> float:
    """Return `value` of a rate axis clamped to `share` of the axis' range on its side of rest."""
    most = axis.rest + share * (axis.maximum - axis.rest)
    least = axis.rest - share * (axis.rest - axis.minimum)
    return min(max(value, least), most)
