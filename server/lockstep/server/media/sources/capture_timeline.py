"""When a medium was captured, told from its own time and its arrival. No I/O, no clock is read here.

A medium that waited on its way arrives late, and arrival alone would make it look younger than it is. Its own time
tells: the one that came quickest shows what the source's clock reads when ours reads something, and every other is
placed by it. So a capture time is never too late as long as the quickest took no longer than the configured latency,
but for what two clocks drift until the next quick one, 0.4 ms a second at most. It is too early by what the quickest
took less.
"""

__all__ = ["CaptureTimeline"]

DRIFT = 0.0002  # of a source's clock against ours that is followed; beyond it the source only seems to run late
JUMP = 1.0  # s by which a source's clock may jump before everything is learnt anew
SETTLE = 0.5  # s until the quickest of a new connection is trusted: it may begin with what had been waiting


class CaptureTimeline:
    """One per connection to a source. Call `place` for every medium, in the order of arrival."""

    def __init__(self, latency: float, *, settle: float = SETTLE) -> None:
        self._latency = latency
        self._settle = settle
        self._began: float | None = None  # arrival of the first since the clock last jumped
        self._offset = 0.0  # our clock - the source's, of the quickest
        self._arrival = 0.0  # of the last one
        self._start = 0.0  # the last one's own time
        self.lag = 0.0  # s that the last one was slower than the quickest

    def place(self, start: float | None, length: float, arrival: float) -> float | None:
        """Our clock's time at the start of a medium of `length` s that says `start` and came at `arrival`.

        `start` None: it has no time of its own. The answer None: not known well enough yet.
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
        """A new clock; whatever was late before is still taken to be so."""
        self._began, self._offset = arrival, offset - lag
