"""Keeps the newest status of the robot. No clock: the caller hands in `now`, s on the monotonic clock."""

import msgspec

from lockstep.protocol.actions import Status
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["StatusService"]

RATE, BURST = 10.0, 10.0  # Hz; a bridge sends two a second, and more when a hardware stop changes


class StatusService:
    """Call `take` with each status of the robot. The age of a reading grows while no other status comes."""

    def __init__(self) -> None:
        self._status: Status | None = None
        self._arrived_at = 0.0
        self._bucket = TokenBucket(RATE, BURST)

    def take(self, status: Status, now: float) -> bool:
        """Keep a status. False if they come too fast: everyone is told a later one."""
        self._status, self._arrived_at = status, now
        return self._bucket.take(now)

    def message(self, now: float) -> Status | None:
        """Return the newest status with the ages that its readings have now; None before the first."""
        if self._status is None:
            return None
        since = max(0.0, now - self._arrived_at)
        items = [msgspec.structs.replace(item, age=min(item.age + since, 1e9)) for item in self._status.items]
        return msgspec.structs.replace(self._status, items=items)

    def forget(self) -> None:
        """Forget the status: it was another bridge's."""
        self._status = None
