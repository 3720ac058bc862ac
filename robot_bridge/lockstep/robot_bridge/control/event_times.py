"""Remembers which event held at which time, for media that reach the bridge after their capture. No I/O, no clock."""

from collections import deque

from lockstep.robot_bridge.robots.base import Stamp

__all__ = ["EventTimes"]

HISTORY = 1024  # changes remembered; at 60 events/s that is 17 s


class EventTimes:
    """The newest `HISTORY` changes of the current event. Call `changed` whenever an event becomes current."""

    def __init__(self) -> None:
        self._changes: deque[Stamp] = deque(maxlen=HISTORY)  # the event that held from each time on

    def changed(self, event: int, now: float) -> None:
        """Note that `event` became current; a repeat of the current event changes nothing."""
        if not self._changes or self._changes[-1].event != event:
            self._changes.append(Stamp(event, now))

    def began(self, event: int) -> float | None:
        """Return when `event` became current, s; None if that is not remembered."""
        for change in reversed(self._changes):
            if change.event == event:
                return change.time
        return None

    def at(self, time: float) -> Stamp | None:
        """Return the event that held at `time`; None for a time before the remembered events."""
        for change in reversed(self._changes):
            if change.time <= time:
                return Stamp(change.event, time)
        return None
