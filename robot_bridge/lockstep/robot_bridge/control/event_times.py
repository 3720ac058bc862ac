"""Which event held when, for media that were captured a while before they reach the bridge. No I/O, no clock."""

from collections import deque

from lockstep.robot_bridge.robots.base import Stamp

__all__ = ["EventTimes"]

HISTORY = 512  # changes remembered; at 25 events/s that is 20 s


class EventTimes:
    """Call `changed` whenever an event becomes current."""

    def __init__(self) -> None:
        self._changes: deque[Stamp] = deque(maxlen=HISTORY)  # from each time on, its event held

    def changed(self, event: int, now: float) -> None:
        """A repeat of the current event changes nothing."""
        if not self._changes or self._changes[-1].event != event:
            self._changes.append(Stamp(event, now))

    def at(self, time: float) -> Stamp | None:
        """The event that held at `time`; None for a time before the remembered events."""
        for change in reversed(self._changes):
            if change.time <= time:
                return Stamp(change.event, time)
        return None
