"""Token buckets, one for each key that asks: an address, a token. No I/O, no clock; bounded in memory."""

from collections import OrderedDict

from lockstep.rtc.token_bucket import TokenBucket

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
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()

    def __len__(self) -> int:
        return len(self._buckets)

    def spend(self, key: str, now: float) -> bool:
        """Take one token; False if the bucket is empty."""
        if key not in self._buckets:
            if len(self._buckets) >= self._max_keys:
                self._buckets.popitem(last=False)
            self._buckets[key] = TokenBucket(self._rate, self._burst)
        self._buckets.move_to_end(key)
        return self._buckets[key].take(now)
