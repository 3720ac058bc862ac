"""Token buckets, one for each key that asks: an address, a token. No I/O, no clock; bounded in memory."""

from collections import OrderedDict

__all__ = ["RateLimits"]

MAX_KEYS = 10_000


class RateLimits:
    """Limits how often each key may do something. A key that was not seen for long is forgotten: its bucket is full.

    With more keys than fit, the one that asked longest ago is forgotten too early. That favours an attacker with ten
    thousand addresses, whom only the network can stop.
    """

    def __init__(self, rate: float, burst: int, max_keys: int = MAX_KEYS) -> None:
        self._rate = rate
        self._burst = burst
        self._max_keys = max_keys
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()  # level, and when

    def __len__(self) -> int:
        return len(self._buckets)

    def spend(self, key: str, now: float) -> bool:
        """Take one token; False if the bucket is empty."""
        level = self._level(key, now)
        allowed = level >= 1
        self._buckets[key] = (level - 1 if allowed else level, now)
        self._buckets.move_to_end(key)
        if len(self._buckets) > self._max_keys:
            self._buckets.popitem(last=False)
        return allowed

    def _level(self, key: str, now: float) -> float:
        level, at = self._buckets.get(key, (float(self._burst), now))
        return min(self._burst, level + max(0.0, now - at) * self._rate)
