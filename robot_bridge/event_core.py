"""The event reference and exactly-once execution. No I/O, no clock: the caller hands in `now`.

Call order: `issue` once (the first feedback), then `command`, `rest`, `stop`, `reset` in any order; after every tick,
when `issue_due`, measure the robot and call `issue`, which answers the pending command or measures the current event
again. Rules and reasons: docs/robot-link.md, "Exactly once".
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from robot_bridge.protocol.description import Axis
from robot_bridge.protocol.messages import Command, Feedback, Refusal, RefusalReason, StopState
from robot_bridge.protocol.serial import FIRST_EVENT, event_after, event_gap, is_event, is_newer
from robot_bridge.robots.base import Measurement

__all__ = ["Absorbed", "Answered", "CommandOutcome", "EventCore", "Executed", "Refused"]

REFRESH_INTERVAL = 0.5  # s between issues of the same event while nothing is commanded
MAX_REMEMBERED_ISSUES = 1024  # of the current event; a forgotten issue counts as late


class Executed(NamedTuple):
    """Drive the axes with these values; the event is pending until the next `issue`."""

    event: int
    values: list[float]


class Answered(NamedTuple):
    """A repeat of the current event: send its stored feedback again."""

    feedback: Feedback


class Absorbed(NamedTuple):
    """A repeat of the pending event: its feedback is on the way."""

    event: int


class Refused(NamedTuple):
    refusal: Refusal


CommandOutcome = Executed | Answered | Absorbed | Refused


class EventCore:
    """Owns `s`. Executes each event at most once and never on the strength of an old feedback."""

    def __init__(
        self,
        axes: Sequence[Axis],
        *,
        max_event_age: float,
        first_event: int = FIRST_EVENT,
        refresh_interval: float = REFRESH_INTERVAL,
    ) -> None:
        if not is_event(first_event):
            raise ValueError(f"the first event must be a valid reference, not {first_event}")
        self._rest_values = [axis.rest for axis in axes]
        self._max_event_age = max_event_age
        self._refresh_interval = refresh_interval
        self._current = first_event  # s: latest executed and answered event, 1
        self._pending: int | None = None  # executed, waiting for its feedback, 2
        self._feedback: Feedback | None = None  # latest issue of the current event; None before the first
        self._issue = 0  # number of the current event's latest issue, 2
        self._issued: dict[int, float] = {}  # issue of the current event -> when, {2: 1042.5}
        self._issue_wanted = True  # issue again at the end of this tick
        self._rested: int | None = None  # moving commands up to this event are void, 2
        self._stop = StopState()

    @property
    def current(self) -> int:
        """The event reference `s`."""
        return self._current

    @property
    def pending(self) -> int | None:
        """The event that was executed and waits for its feedback; None when there is none."""
        return self._pending

    @property
    def feedback(self) -> Feedback | None:
        """The latest issue; None before the first."""
        return self._feedback

    @property
    def stop_state(self) -> StopState:
        return self._stop

    def command(self, command: Command, now: float) -> CommandOutcome:
        """Decide about a command that arrived now."""
        if len(command.values) != len(self._rest_values):
            return self._refuse(
                command, "wrong_size", f"{len(command.values)} values for {len(self._rest_values)} axes"
            )
        if not all(map(math.isfinite, command.values)):
            return self._refuse(command, "not_a_number")
        if self._stop.stopped:
            return self._refuse(command, "stopped", self._stop.reason)
        if command.event == self._current and self._feedback is not None:
            return Answered(self._feedback)
        if command.event == self._pending:
            return Absorbed(command.event)
        if command.event != event_after(self._current):  # also while an event is pending: that is the one after s
            return self._refuse(command, "out_of_order")
        return self._next_command(command, now)

    def _next_command(self, command: Command, now: float) -> CommandOutcome:
        issued = self._issued.get(command.issue)
        if issued is None or now - issued > self._max_event_age:
            self._issue_wanted = True
            return self._refuse(command, "late")
        moving = command.values != self._rest_values
        if moving and self._rested is not None and not is_newer(command.event, self._rested):
            return self._refuse(command, "rested")
        self._pending = command.event
        self._rested = None  # every event it could void is now behind; a stale mark must not survive the wrap
        return Executed(command.event, command.values)

    def refusal(self, event: int, reason: RefusalReason, detail: str = "") -> Refusal:
        """A refusal that names the current event."""
        return Refusal(event=event, reason=reason, current=self._current, detail=detail[:500])

    def rest(self, event: int) -> bool:
        """Void moving commands up to `event`. True: bring the axes to rest; False: superseded by a newer event.

        A reference further ahead than the next event cannot come from a correct peer. The axes still come to rest,
        but nothing beyond the next event is voided, or one bad message would stop the robot for good.
        """
        newest = self._current if self._pending is None else self._pending
        if is_newer(newest, event):
            return False
        following = event_after(newest)
        ahead = is_newer(event, following) or event_gap(event, newest) < 0
        voided = following if ahead else event
        if self._rested is None or is_newer(voided, self._rested):  # rests may arrive in any order
            self._rested = voided
        return True

    def stop(self, by: str, reason: str) -> bool:
        """Latch the stop. False when it was latched before: the first reason stands."""
        if self._stop.stopped:
            return False
        self._stop = StopState(stopped=True, by=by, reason=reason)
        self._issue_wanted = True
        return True

    def reset(self) -> bool:
        """Release the stop; moves nothing. False when it was not latched."""
        if not self._stop.stopped:
            return False
        self._stop = StopState()
        self._issue_wanted = True
        return True

    def want_issue(self) -> None:
        """Issue again at the end of this tick (somebody joined)."""
        self._issue_wanted = True

    def issue_due(self, now: float) -> bool:
        """Whether to measure and `issue` now."""
        if self._pending is not None or self._issue_wanted or self._feedback is None:
            return True
        return now - self._feedback.time >= self._refresh_interval

    def issue(
        self, measured: Measurement, now: float, limits: Sequence[str] = (), unknown: Sequence[str] = ()
    ) -> Feedback:
        """The feedback of the pending event, which thereby becomes current, or of the current event again."""
        if self._pending is not None:
            self._current, self._pending = self._pending, None
            self._issued.clear()
            self._issue = 0
        self._issue += 1
        self._issue_wanted = False
        self._remember_issue(now)
        self._feedback = Feedback(
            event=self._current,
            issue=self._issue,
            time=now,
            axes=measured.axes,
            joints=measured.joints,
            wrench=measured.wrench,
            ranges=measured.ranges,
            at_rest=measured.at_rest,
            stop=self._stop,
            faults=measured.faults,
            limits=list(limits),
            unknown=list(unknown),
        )
        return self._feedback

    def _remember_issue(self, now: float) -> None:
        """Issues come in order of time, so the forgotten ones are always the oldest."""
        while self._issued:
            oldest = next(iter(self._issued))
            if len(self._issued) < MAX_REMEMBERED_ISSUES and now - self._issued[oldest] <= self._max_event_age:
                break
            del self._issued[oldest]
        self._issued[self._issue] = now

    def _refuse(self, command: Command, reason: RefusalReason, detail: str = "") -> Refused:
        return Refused(self.refusal(command.event, reason, detail))
