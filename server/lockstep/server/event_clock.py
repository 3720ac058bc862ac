"""The event clock: tracks the event reference by the bridge's feedback. No I/O."""

from collections import deque
from typing import NamedTuple

from lockstep.protocol.messages import EventReference, Feedback, StopState
from lockstep.protocol.serial import FIRST_EVENT, event_gap

__all__ = ["EventClock"]

HISTORY = 1024  # changes remembered; at 60 events/s that is 17 s, longer than any medium takes to arrive

DRIVEN_SECONDS = 1.0


class Change(NamedTuple):
    """A change of the event reference: from `time` on, `event` held."""

    time: float
    event: EventReference


class EventClock:
    """Follows the feedback of one epoch at a time. Within an epoch the reference never goes back."""

    def __init__(self) -> None:
        self.epoch = ""
        self.feedback: Feedback | None = None  # newest of this epoch; None before the first
        self.heard_at = 0.0  # arrival of `feedback`
        self._changes: deque[Change] = deque(maxlen=HISTORY)

    @property
    def event(self) -> EventReference:
        return FIRST_EVENT if self.feedback is None else self.feedback.event

    def is_driven(self, now: float) -> bool:
        """Return whether an event was executed within the last second."""
        return bool(self._changes) and now - self._changes[-1].time < DRIVEN_SECONDS

    @property
    def stop(self) -> StopState:
        return StopState() if self.feedback is None else self.feedback.stop

    @property
    def moving(self) -> bool:
        """True if the robot was not at rest at its last measurement."""
        return self.feedback is not None and not self.feedback.at_rest

    def begin(self, epoch: str) -> bool:
        """Take the bridge's epoch. Return True if it is a new one: everything starts anew."""
        if epoch == self.epoch:
            return False
        self.epoch = epoch
        self.feedback = None
        self._changes.clear()
        return True

    def observe(self, feedback: Feedback, now: float) -> bool:
        """Take a feedback. Return False if it is older than the known one; then nothing changes."""
        if self.feedback is not None:
            gap = event_gap(feedback.event, self.feedback.event)
            if gap < 0 or (gap == 0 and feedback.issue <= self.feedback.issue):
                return False
        if self.feedback is None or feedback.event != self.feedback.event:
            self._changes.append(Change(now, feedback.event))
        self.feedback, self.heard_at = feedback, now
        return True

    def reference_at(self, time: float) -> EventReference | None:
        """Return the reference that held at `time`: the stamp for a medium captured here. None if that is too long ago.

        A change counts from the arrival of its feedback, later than it happened: a stamp is never newer than the truth.
        """
        for change in reversed(self._changes):
            if change.time <= time:
                return change.event
        return None
