"""Statistics of samples. No I/O."""

import math
from collections.abc import Sequence

__all__ = ["median", "quantile"]


def quantile(samples: Sequence[float], share: float) -> float:
    """Return the nearest-rank quantile: the least sample that at least `share` of all are not above.

    Raises:
        ValueError: there are no samples, or `share` is not between 0 and 1.
    """
    if not samples:
        raise ValueError("no samples")
    if not 0 < share <= 1:
        raise ValueError(f"a share is above 0 and at most 1, not {share}")
    # The product may be a hair above a whole number: 0.07 * 100 is 7.000000000000001.
    rank = math.ceil(share * len(samples) - 1e-9)
    return sorted(samples)[max(rank, 1) - 1]


def median(samples: Sequence[float]) -> float:
    """Return the nearest-rank median.

    Raises:
        ValueError: there are no samples.
    """
    return quantile(samples, 0.5)
