"""Keeps the newest map and navigation of the robot. No clock: the caller hands in `now`, s on the monotonic clock."""

import msgspec

from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["NavigationService"]

RATE, BURST = 10.0, 10.0  # Hz; a bridge sends five a second


class NavigationService:
    """Call `take` with each navigation of the robot and `take_map` with each map."""

    def __init__(self) -> None:
        self._navigation: Navigation | None = None
        self._arrived_at = 0.0
        self._map: OccupancyMap | None = None
        self._bucket = TokenBucket(RATE, BURST)

    @property
    def map(self) -> OccupancyMap | None:
        """The newest map; None before the first."""
        return self._map

    def take(self, navigation: Navigation, now: float) -> bool:
        """Keep a navigation. False if they come too fast: everyone is told a later one."""
        self._navigation, self._arrived_at = navigation, now
        return self._bucket.take(now)

    def take_map(self, map: OccupancyMap) -> None:
        """Keep a map in place of the one before."""
        self._map = map

    def message(self, now: float) -> Navigation | None:
        """Return the newest navigation with the ages that it has now; None before the first."""
        if self._navigation is None:
            return None
        since = max(0.0, now - self._arrived_at)
        told = self._navigation
        return msgspec.structs.replace(
            told, map_age=min(told.map_age + since, 1e9), path_age=min(told.path_age + since, 1e9)
        )

    def forget(self) -> None:
        """Forget both: they were another bridge's."""
        self._navigation = self._map = None
