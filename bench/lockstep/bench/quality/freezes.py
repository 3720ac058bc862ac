"""Finds freezes by the W3C's definition in webrtc-stats."""

from collections.abc import Sequence

__all__ = ["freezes"]

EXTRA, TIMES = 0.150, 3.0  # freezeCount: an interval longer than max(3 d, d + 150 ms)
WINDOW = 30  # pictures over which the usual interval d is computed


def freezes(times: Sequence[float]) -> list[float]:
    """Return the lengths, in s, of the intervals between pictures that count as freezes."""
    found = []
    for i in range(2, len(times)):  # the first interval has none before it to compare with
        before = times[max(0, i - WINDOW) : i]
        usual = (before[-1] - before[0]) / (len(before) - 1)
        interval = times[i] - times[i - 1]
        if interval > max(TIMES * usual, usual + EXTRA):
            found.append(interval)
    return found
