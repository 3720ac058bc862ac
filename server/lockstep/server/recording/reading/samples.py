"""Values of which percentiles are asked for. No I/O."""

from collections.abc import Mapping

__all__ = ["Samples", "percentile_of"]

MAX_VALUES = 100_000  # of a series; then every other one is left out


class Samples:
    """Values of which percentiles are asked for; thinned out when there are too many."""

    def __init__(self) -> None:
        self._values: list[float] = []
        self._every = 1
        self._skipped = 0

    def add(self, value: float) -> None:
        self._skipped += 1
        if self._skipped < self._every:
            return
        self._skipped = 0
        self._values.append(value)
        if len(self._values) >= MAX_VALUES:
            self._values = self._values[::2]
            self._every *= 2

    def percentile(self, share: float) -> float | None:
        """Return the value that `share` (0 to 1) of them do not exceed; None without any."""
        if not self._values:
            return None
        ordered = sorted(self._values)
        return ordered[_rank(len(ordered), share)]


def percentile_of(counts: Mapping[float, int], share: float) -> float | None:
    """Return the same of values that were counted. `counts`: how often there is each value, 0 at least."""
    total = sum(counts.values())
    rank = _rank(total, share)
    for value in sorted(counts) if total else ():
        rank -= counts[value]
        if rank < 0:
            return value
    return None


def _rank(count: int, share: float) -> int:
    return min(count - 1, int(share * count))
