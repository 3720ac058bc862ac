"""How much a process grows, from samples of its memory. No I/O."""

from collections.abc import Sequence
from statistics import median

__all__ = ["WARM_UP", "growth"]

WARM_UP = 0.25  # share of a life after which its memory is compared
WINDOW = 0.25  # share of the rest that is taken at its beginning and at its end


def growth(samples: Sequence[float]) -> float | None:
    """Relative growth from the beginning to the end of one life, after the warm-up; None for too few samples.

    Medians of the two ends are compared, so that a moment with more or fewer observers does not count.
    """
    warm = samples[int(len(samples) * WARM_UP) :]
    size = int(len(warm) * WINDOW)
    if size < 1:
        return None
    return median(warm[-size:]) / median(warm[:size]) - 1
