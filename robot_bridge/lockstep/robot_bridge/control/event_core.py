"""The event reference and exactly-once execution. No I/O, no clock: the caller hands in `now`.

Call order: `issue` once (the first feedback), then `command`, `rest`, `stops.stop`, `stops.reset` and the others in any
order; after every tick, when `issue_due`, measure the robot and call `issue`, which answers the pending command or
measures the current event again. Rules and reasons: docs/robot-link.md, "Exactly once" and "Coming to rest".
"""

import math
import secrets
from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec

from lockstep.protocol.description import Axis, Pose, StartWarning
from lockstep.protocol.messages import Command, Feedback, Refusal, RefusalReason, RobotFeedback
from lockstep.protocol.serial import FIRST_EVENT, event_after, event_gap, is_event, is_newer
from lockstep.protocol.traces.trace import CommandSpans
from lockstep.robot_bridge.control.goals.command_values import CommandValues
from lockstep.robot_bridge.control.issue_schedule import IssueSchedule
from lockstep.robot_bridge.control.restart_interlock import RestartInterlock
from lockstep.robot_bridge.robots.base import Measurement
from lockstep.robot_bridge.stop.stop_core import StopCore

__all__ = ["Absorbed", "Answered", "CommandOutcome", "EventCore", "Executed", "Refused", "draw_nonce"]

MAX_REMEMBERED_ISSUES = 1024  # of the current event; a forgotten issue counts as late
MAX_NONCE = 2**53 - 1  # a JavaScript number holds these exactly


def draw_nonce() -> int:
    """Return a nonce that cannot be guessed; never 0, which stands for a command without a nonce."""
    return 1 + secrets.randbelow(MAX_NONCE)


class _Issued(NamedTuple):
    """An issue of the current event, for the check of the command that answers it."""

    time: float  # s
    nonce: int
    spell: int  # of the restart interlock


class Executed(NamedTuple):
    """The command executes: drive the axes with these values. The event is pending until the next `issue`."""

    event: int
    values: Sequence[float | None]
    speed: float = 1.0  # of the goal axes, as a share of their largest


class Answered(NamedTuple):
    """The command repeats the current event: send its stored feedback again."""

    feedback: Feedback


class Absorbed(NamedTuple):
    """The command repeats the pending event: its feedback is on the way."""

    event: int


class Refused(NamedTuple):
    refusal: Refusal


CommandOutcome = Executed | Answered | Absorbed | Refused


class EventCore:
    """Owns the event reference `s` and executes each event at most once.

    No command executes on the strength of an old feedback or of one not seen, and none moves the robot before a neutral
    command while the interlock asks for one.

    Attributes:
        values: judges the values of commands
        interlock: whether moving commands may execute
        stops: the latched stop; while it holds no command executes
    """

    def __init__(
        self,
        axes: Sequence[Axis],
        *,
        max_event_age: float,
        first_event: int = FIRST_EVENT,
        max_event_rate: float = math.inf,
        start_warning: StartWarning | None = None,
        poses: Sequence[Pose] = (),
        measured: Callable[[], Sequence[float]] | None = None,
        nonces: Callable[[], int] = draw_nonce,
    ) -> None:
        """`max_event_rate`: Hz, of answered commands. `nonces`: draws the nonce of each issue.

        `measured`: returns the measured value of each axis now, for the reach of goals; called for a command with
        goals. Without it every goal is a `jump`.
        """
        if not is_event(first_event):
            raise ValueError(f"the first event must be a valid reference, not {first_event}")
        signal = "" if start_warning is None else start_warning.axis
        self.values = CommandValues(axes, poses=poses, signal=signal, measured=measured)
        self._schedule = IssueSchedule(max_event_rate)
        self.interlock = RestartInterlock(self._schedule, start_warning)
        self.stops = StopCore(self.interlock, self._schedule)
        self._max_event_age = max_event_age
        self._current = first_event  # s: latest executed and answered event, 1
        self._pending: int | None = None  # executed, waiting for its feedback, 2
        self._feedback: Feedback | None = None  # latest issue of the current event; None before the first
        self._issue = 0  # number of the current event's latest issue, 2
        self._issued: dict[int, _Issued] = {}  # issues of the current event, oldest first
        self._nonces = nonces
        self._rested: int | None = None  # moving commands up to this event are void, 2

    @property
    def current(self) -> int:
        """The event reference `s`."""
        return self._current

    @property
    def pending(self) -> int | None:
        """The event that was executed and waits for its feedback; None without such an event."""
        return self._pending

    @property
    def feedback(self) -> Feedback | None:
        """The latest issue; None before the first."""
        return self._feedback

    def command(self, command: Command, now: float) -> CommandOutcome:
        """Decide about a command that arrived now."""
        if (misfit := self.values.misfit(command.values, command.speed)) is not None:
            return self._refuse(command, *misfit)
        if (stop := self.stops.state).stopped:
            return self._refuse(command, "stopped", stop.reason)
        if command.event == self._current and self._feedback is not None:
            return Answered(self._feedback)
        if command.event == self._pending:
            return Absorbed(command.event)
        if command.event != event_after(self._current):  # also while an event is pending: that is the one after s
            return self._refuse(command, "out_of_order")
        return self._next_command(command, now)

    def _next_command(self, command: Command, now: float) -> CommandOutcome:
        issued = self._issued.get(command.issue)
        if issued is None or now - issued.time > self._max_event_age:
            self._schedule.want()
            return self._refuse(command, "late")
        if command.nonce != issued.nonce:
            return self._refuse(command, "unseen")
        moving = self.values.moves(command.values)
        if moving and self._rested is not None and not is_newer(command.event, self._rested):
            return self._refuse(command, "rested")
        self.interlock.look(now)
        if moving and (reason := self.interlock.judge_moving(issued.time, now)) is not None:
            return self._refuse(command, reason)
        if moving and (far := self.values.jump(command.values)):  # last: it measures the robot
            return self._refuse(command, "jump", far)
        self.interlock.executed(moving=moving, spell=issued.spell, now=now)
        if not self.interlock.needed:
            self.stops.latch.may_move()
        self._pending = command.event
        self._rested = None  # every event it could void is now behind; a stale mark must not survive the wrap
        return Executed(command.event, command.values, command.speed)

    def refusal(self, event: int, reason: RefusalReason, detail: str = "", *, stop: int = 0) -> Refusal:
        """Return a refusal that names the current event. `stop`: the stop that a refused reset named."""
        return Refusal(event=event, reason=reason, current=self._current, detail=detail[:500], stop=stop)

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

    def want_issue(self) -> None:
        """Issue again at the end of this tick, because a client joined."""
        self._schedule.want()

    def issue_due(self, now: float) -> bool:
        """Return whether to measure and `issue` now.

        An answer that comes sooner than the event rate allows waits, and with it the next event: nothing is refused. A
        stop is fed back at once.
        """
        self.interlock.look(now)
        if self._pending is None:
            return self._schedule.due(now)
        return self.stops.state.stopped or self._schedule.answer_due(now)

    def issue(
        self,
        measured: Measurement,
        now: float,
        limits: Sequence[str] = (),
        unknown: Sequence[str] = (),
        *,
        goals: Sequence[float | None] = (),
        time: float | None = None,
        spans: CommandSpans | msgspec.UnsetType = msgspec.UNSET,
    ) -> Feedback:
        """Return the feedback of the pending event, which thereby becomes current, or of the current event again.

        `goals`: where the goal axes are commanded to be now, None for a rate axis. `time`: the time of issue, on the
        clock of capture times; None: `now`. `spans`: of the pending command.
        """
        self._schedule.issued(now, answers=self._pending is not None)
        if self._pending is not None:
            self._current, self._pending = self._pending, None
            self._issued.clear()
            self._issue = 0
        self._issue += 1
        nonce, stop = self._nonces(), self.stops.state
        self._remember_issue(_Issued(now, nonce, self.interlock.spell))
        self.stops.latch.shown(stop, now)
        self._feedback = RobotFeedback(
            event=self._current,
            issue=self._issue,
            time=now if time is None else time,
            axes=measured.axes,
            joints=measured.joints,
            goals=goals,
            wrench=measured.wrench,
            ranges=measured.ranges,
            at_rest=measured.at_rest,
            stop=stop,
            faults=measured.faults,
            limits=list(limits),
            unknown=list(unknown),
            nonce=nonce,
            neutral_needed=self.interlock.needed,
            warning=self.interlock.warns(now),
            spans=spans,
        )
        return self._feedback

    def _remember_issue(self, issued: _Issued) -> None:
        """Keep the issue and forget those too old or too many: issues come in order of time, so the oldest go."""
        while self._issued:
            oldest = next(iter(self._issued))
            if (
                len(self._issued) < MAX_REMEMBERED_ISSUES
                and issued.time - self._issued[oldest].time <= self._max_event_age
            ):
                break
            del self._issued[oldest]
        self._issued[self._issue] = issued

    def _refuse(self, command: Command, reason: RefusalReason, detail: str = "") -> Refused:
        return Refused(self.refusal(command.event, reason, detail))
