"""How long the quickest medium of a remote sender can have been on its way, at most. No I/O, no clock is read.

Arrival alone does not tell how long a picture travelled: two clocks that share nothing show no one-way delay. A round
trip does bound it: a check of ours goes there and its answer comes back, and neither way takes longer than both. So the
shortest round trip is at least what the quickest packet of that time took.

`CaptureTimeline` lets the quickest grow older by `DRIFT` each second, to follow clocks. The shortest round trip grows
with it, so that both stay as far apart as they were when they were measured: on a path that becomes slower, stamps
never become newer than the pictures are.
"""

from lockstep.server.media.sources.capture_timeline import DRIFT

__all__ = ["PathBound"]


class PathBound:
    """Call `observe` for each round trip that was measured."""

    def __init__(self) -> None:
        self._least: float | None = None  # s
        self._at = 0.0
        self.newest: float | None = None  # s, the last round trip; None before the first

    def observe(self, round_trip: float, now: float) -> None:
        """A check that left `round_trip` s ago was answered now."""
        self.newest = max(0.0, round_trip)
        known = self.seconds(now)
        self._least = self.newest if known is None else min(self.newest, known)
        self._at = now

    def seconds(self, now: float) -> float | None:
        """None while no round trip was measured."""
        return None if self._least is None else self._least + DRIFT * max(0.0, now - self._at)
