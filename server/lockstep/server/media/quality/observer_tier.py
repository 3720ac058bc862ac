"""Chooses between the two observers' tiers for a peer. No I/O.

| in | when | then |
|---|---|---|
| high | its path carries less than 60 % of what high needs | low |
| low | its patience is over, and its path showed no sign of a limit for 10 s | high, as a trial |
| high | it falls back within 20 s of a trial | low, with twice the patience: 10 s to 160 s |
"""

from lockstep.protocol.console import Tier
from lockstep.server.media.quality.path.bandwidth_estimator import BandwidthEstimator

__all__ = ["ObserverTier"]

ENOUGH = 0.6
TRIAL = 20.0  # s
PATIENCE, MOST_PATIENCE = 10.0, 160.0  # s


class ObserverTier:
    """The tier of one observer; begins with the high tier."""

    def __init__(self, now: float) -> None:
        self.tier: Tier = "high"
        self._since = now
        self._patience = PATIENCE
        self._tried = False

    def decide(self, path: BandwidthEstimator, high_bps: float, now: float) -> Tier:
        """Return the tier; `high_bps` is the bitrate that the high tier needs of a path."""
        if self.tier == "high":
            if path.rate < ENOUGH * high_bps:
                hasty = self._tried and now - self._since < TRIAL
                self._patience = min(MOST_PATIENCE, 2 * self._patience) if hasty else PATIENCE
                self.tier, self._since = "low", now
        elif now - self._since >= self._patience and path.calm_for(now) >= PATIENCE:
            self.tier, self._since, self._tried = "high", now, True
            path.assume(high_bps, now)
        return self.tier
