"""Measures acknowledgements, and tells the time to wait for one before a chunk is repeated (RFC 9260 6.3)."""

from collections import deque
from itertools import islice

from lockstep.rtc.sctp.settings import SctpSettings

__all__ = ["RoundTrip"]

SHORT = 8  # samples, of which the shortest is the path's own round trip, and not an outage's
LONG = 32  # samples, of which the longest shows the path's jitter
LARGEST_FACTOR = 8.0
FACTOR_LASTS = 30.0  # s, after which half of it is given back


class RoundTrip:
    """The smoothed round trip, and the two intervals that follow from it.

    The first repeat of a chunk comes after the smoothed round trip and a margin: four times its variation, or that of
    the longest of the latest samples, if that is more; but no later than 1.5 round trips and `margin_ceiling`. It is a
    tail loss probe (RFC 8985 7) instead of RFC 9260's second or more. Where the delay varies by more than that, repeats
    are needless; the peer reports them as duplicates, and each such report doubles the bound for a while.
    """

    def __init__(self, settings: SctpSettings) -> None:
        self._settings = settings
        self._variation = 0.0
        self._latest: deque[float] = deque(maxlen=LONG)
        self._factor = 1.0
        self._factor_ends = 0.0
        self._probe = settings.initial_timeout
        self._ceiling = settings.timeout_ceiling
        self.smoothed: float | None = None  # s
        self.reordering = 0.0  # s after it left, before which a chunk is late and not lost
        self.sampled_at = float("-inf")

    def sample(self, seconds: float, now: float) -> None:
        """Take a sample: a chunk that was sent once, with the I bit, was acknowledged after `seconds` (Karn's rule, RFC
        9260 6.3.1 C5). One sample a round trip is used (C4), so that the latest samples cover some time. A caller's
        clock may go back a little between two calls; no acknowledgement comes before its chunk."""
        seconds = max(seconds, 0.0)
        if self.smoothed is not None and now - self.sampled_at < self.smoothed:
            return
        if self.smoothed is None:
            self.smoothed, self._variation = seconds, seconds / 2  # RFC 9260 6.3.1 C2
        else:
            self._variation += (abs(self.smoothed - seconds) - self._variation) / 4
            self.smoothed += (seconds - self.smoothed) / 8
        self._latest.append(seconds)
        self.sampled_at = now
        if self._factor > 1.0 and now >= self._factor_ends:
            self._factor /= 2
            self._factor_ends = now + FACTOR_LASTS
        self._decide()

    def needless(self, now: float) -> None:
        """Note that the peer already had a chunk that was repeated."""
        self._factor = min(2 * self._factor, LARGEST_FACTOR)
        self._factor_ends = now + FACTOR_LASTS
        self._decide()

    def _decide(self) -> None:
        if self.smoothed is None:
            return
        settings, factor = self._settings, self._factor
        longest, extra = max(self._latest), self.smoothed / 8
        self.reordering = longest + extra
        wanted = max(4 * self._variation, longest - self.smoothed + max(settings.margin_floor, extra) * factor)
        most = (self.smoothed / 2 + settings.margin_ceiling) * factor
        if len(self._latest) < SHORT:
            wanted = most  # too few to know the jitter
        self._ceiling = max(settings.timeout_ceiling, 2 * min(islice(reversed(self._latest), SHORT)))
        self._probe = min(self.smoothed + min(wanted, most), self._ceiling)

    def timeout(self, expiries: int) -> float:
        """Return the time in s to wait for an acknowledgement after so many waits in vain (RFC 9260 6.3.3 E2)."""
        if expiries == 0:
            return self._probe
        return min(self._probe * (1 << min(expiries, 16)), self._ceiling)
