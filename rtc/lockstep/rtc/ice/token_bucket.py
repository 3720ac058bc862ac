"""Limits rates, with bursts."""

from array import array

__all__ = ["TokenBuckets"]


class TokenBuckets:
    """`take` permits `burst` at once and `rate` a second in the long run, in each of `count` buckets.

    The memory has one size from the beginning, under any load.
    """

    def __init__(self, rate: float, burst: float, count: int = 1) -> None:
        self._rate = rate
        self._burst = burst
        self._tokens = array("d", [burst]) * count
        self._at = array("d", [float("-inf")]) * count

    def __len__(self) -> int:
        return len(self._tokens)

    def take(self, now: float, bucket: int = 0) -> bool:
        tokens = min(self._burst, self._tokens[bucket] + max(0.0, now - self._at[bucket]) * self._rate)
        self._at[bucket] = max(self._at[bucket], now)
        self._tokens[bucket] = tokens - 1.0 if tokens >= 1.0 else tokens
        return tokens >= 1.0
