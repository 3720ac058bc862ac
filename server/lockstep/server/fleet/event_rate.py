"""Measures a robot's event rate, and the age of its link's state. No I/O, no clock: fed once a second."""

from collections import deque

from lockstep.protocol.serial import event_gap

__all__ = ["EventRateMeter"]

WINDOW = 3.0  # s over which the rate is taken


class EventRateMeter:
    """The event rate and the link of one robot. Call `look` at intervals.

    Attributes:
        link_since: time of the link's last change; None: it was never up
    """

    def __init__(self) -> None:
        self.link_since: float | None = None
        self._up = False
        self._epoch = ""
        self._looks: deque[tuple[float, int]] = deque(maxlen=16)  # time, and the current event

    def look(self, now: float, *, up: bool, epoch: str, event: int) -> None:
        if up != self._up:
            self._up, self.link_since = up, now
        if epoch != self._epoch:
            self._epoch = epoch
            self._looks.clear()
        self._looks.append((now, event))
        while self._looks[0][0] < now - WINDOW:
            self._looks.popleft()

    @property
    def event_rate(self) -> float:
        """Events per second over the last few seconds; 0 before there were two looks."""
        if len(self._looks) < 2:
            return 0.0
        (began, first), (now, last) = self._looks[0], self._looks[-1]
        return max(0, event_gap(last, first)) / (now - began) if now > began else 0.0
