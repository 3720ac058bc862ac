"""Derives the capture time of a medium from its own time and its arrival. No I/O, no clock is read here.

A medium that waited on its way arrives late, and arrival alone would make it look younger than it is. Its own time
corrects that: the quickest medium shows the offset between the source's clock and this machine's, and every other is
placed by it. So a capture time is never too late as long as the quickest took no longer than the configured latency,
except for the drift of the two clocks until the next quick one, 0.4 ms a second at most. It is too early by the time
that the quickest took less than the latency.
"""

__all__ = ["CaptureTimeline"]

DRIFT = 0.0002  # of a source's clock that is followed; beyond it the source only seems to run late
JUMP = 1.0  # s by which a source's clock may jump before everything is learnt anew
SETTLE = 0.5  # s until the quickest of a new connection is trusted: it may begin with a backlog


class CaptureTimeline:
    """The time line of one connection to a source. Call `place` for every medium, in the order of arrival."""

    def __init__(self, latency: float, *, settle: float = SETTLE) -> None:
        self._latency = latency
        self._settle = settle
        self._began: float | None = None  # arrival of the first since the clock last jumped
        self._offset = 0.0  # this machine's clock - the source's, of the quickest
        self._arrival = 0.0  # of the last one
        self._start = 0.0  # the last one's own time
        self.lag = 0.0  # s by which the last one was slower than the quickest

    def place(self, start: float | None, length: float, arrival: float) -> float | None:
        """Return this machine's time at the start of a medium of `length` s that came at `arrival`.

        `start`: the medium's own time; None without one. The result is None while it is not known well enough.
        """
        if start is None:
            return arrival - length - self._latency
        offset = arrival - (start + length)
        if self._began is None:
            self._begin(offset, 0.0, arrival)
        elif start < self._start - JUMP or offset < self._offset - JUMP:
            self._begin(offset, self.lag, arrival)
        else:
            self._offset = min(offset, self._offset + DRIFT * max(0.0, arrival - self._arrival))
        self._arrival, self._start = arrival, start
        self.lag = offset - self._offset
        if self._began is None or arrival - self._began < self._settle:
            return None
        return start + self._offset - self._latency

    def _begin(self, offset: float, lag: float, arrival: float) -> None:
        """Begin with a new clock; media that were late before still count as late."""
        self._began, self._offset = arrival, offset - lag
