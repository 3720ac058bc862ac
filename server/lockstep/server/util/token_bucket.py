"""A token bucket, which limits how often something may be done. No I/O, no clock."""

__all__ = ["TokenBucket"]


class TokenBucket:
    """Allows something `burst` times at once, then `rate` times a second; full at first."""

    def __init__(self, rate: float, burst: float, now: float) -> None:
        self._rate = rate
        self._burst = burst
        self._level = burst
        self._at = now

    def has(self, now: float) -> bool:
        """True if `take` would succeed."""
        self._level = min(self._burst, self._level + max(0.0, now - self._at) * self._rate)
        self._at = now
        return self._level >= 1

    def is_full(self, now: float) -> bool:
        """True if the bucket is as full as at first."""
        self.has(now)
        return self._level >= self._burst

    def take(self, now: float) -> bool:
        """Take one token; False if the bucket is empty."""
        if not self.has(now):
            return False
        self._level -= 1
        return True

    def wait(self, now: float) -> float:
        """Seconds until `take` would succeed."""
        return 0.0 if self.has(now) else (1 - self._level) / self._rate
