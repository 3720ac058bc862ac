"""An upper bound of the travel time of a remote sender's quickest medium. No I/O, no clock is read.

Arrival alone does not show how long a picture travelled: two unrelated clocks show no one-way delay. A round trip does
bound it: a check travels to the sender and its answer comes back, and neither way takes longer than both. So the
shortest round trip is at least as long as the quickest packet of that time travelled.

`CaptureTimeline` lets the quickest grow older by `DRIFT` each second, to follow clocks. The shortest round trip grows
with it, so that both stay as far apart as they were when they were measured: on a path that becomes slower, stamps
never become newer than the pictures are.
"""

from lockstep.server.media.sources.capture_timeline import DRIFT

__all__ = ["PathBound"]


class PathBound:
    """Bounds the one-way delay of a path. Call `observe` for each measured round trip."""

    def __init__(self) -> None:
        self._least: float | None = None  # s
        self._at = 0.0
        self.newest: float | None = None  # s, the last round trip; None before the first

    def observe(self, round_trip: float, now: float) -> None:
        """Take the round trip of a check that left `round_trip` s ago and was answered now."""
        self.newest = max(0.0, round_trip)
        known = self.seconds(now)
        self._least = self.newest if known is None else min(self.newest, known)
        self._at = now

    def seconds(self, now: float) -> float | None:
        """Return the bound in s; None before the first round trip."""
        return None if self._least is None else self._least + DRIFT * max(0.0, now - self._at)
