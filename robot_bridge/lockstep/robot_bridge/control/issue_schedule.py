"""Tells when a feedback is due. No I/O, no clock: the caller hands in `now`."""

import math

__all__ = ["IssueSchedule"]

REFRESH_INTERVAL = 0.5  # s between issues of the same event while nothing is commanded
BURST = 2  # events that may arrive ahead of the event rate: the network bunches timely commands


class IssueSchedule:
    """The times of issues. Call `want` after every change that feedback has to tell, and `issued` with each issue."""

    def __init__(self, max_event_rate: float = math.inf) -> None:
        """`max_event_rate`: Hz, of answered commands."""
        self._interval = 1 / max_event_rate  # s between two answers
        self._answer_at = -math.inf  # s, when an answer would be due if all of them kept that interval
        self._issued_at = -math.inf  # s
        self._wanted = True

    def want(self) -> None:
        """Let an issue be due at the end of this tick."""
        self._wanted = True

    def due(self, now: float) -> bool:
        """Return whether an issue of the current event is due."""
        return self._wanted or now - self._issued_at >= REFRESH_INTERVAL

    def answer_due(self, now: float) -> bool:
        """Return whether the answer to a command is due: one that comes sooner than the event rate allows waits."""
        return now >= self._answer_at - BURST * self._interval

    def issued(self, now: float, *, answers: bool) -> None:
        """Note an issue. `answers`: it answers a command."""
        if answers:
            self._answer_at = max(now, self._answer_at) + self._interval
        self._issued_at = now
        self._wanted = False
