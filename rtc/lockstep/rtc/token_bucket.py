"""A token bucket, which limits how often something may be done. No I/O, no clock."""

__all__ = ["TokenBucket"]


class TokenBucket:
    """Permits `burst` at once and `rate` a second in the long run; full at first.

    A clock that goes back gives nothing.

    Attributes:
        rate: tokens that come back each second; may be changed
    """

    __slots__ = ("_at", "_burst", "_level", "rate")

    def __init__(self, rate: float, burst: float) -> None:
        self.rate = rate
        self._burst = burst
        self._level = burst
        self._at = float("-inf")

    def level(self, now: float) -> float:
        """The tokens that are left; below 0 after an overdraft."""
        if now > self._at:
            if self._level < self._burst:
                self._level = min(self._burst, self._level + (now - self._at) * self.rate)
            self._at = now
        return self._level

    def has(self, now: float) -> bool:
        """True if `take` would succeed."""
        return self.level(now) >= 1

    def is_full(self, now: float) -> bool:
        """True if the bucket is as full as at first."""
        return self.level(now) >= self._burst

    def take(self, now: float) -> bool:
        """Take one token; False if the bucket is empty."""
        if self.level(now) < 1:
            return False
        self._level -= 1
        return True

    def overdraw(self, tokens: float, now: float) -> bool:
        """Take `tokens` if any token is left, even if that is fewer, so that every amount passes some time."""
        if self.level(now) <= 0:
            return False
        self._level -= tokens
        return True

    def wait(self, now: float, level: float = 1.0) -> float:
        """Seconds until the bucket holds `level` tokens."""
        return max(0.0, level - self.level(now)) / self.rate
