"""Computes the growth of a process from samples of its memory. No I/O."""

from collections import defaultdict
from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

__all__ = ["WARM_UP", "Sample", "growth", "growth_alike"]

WARM_UP = 0.25  # share of a life after which its memory is compared
WINDOW = 0.25  # share of the rest that is taken at its beginning and at its end
ALIKE = 3  # samples at either end that are enough to compare


class Sample(NamedTuple):
    """The state of a process at one moment."""

    resident: float  # bytes
    encoders: tuple[tuple[str, int], ...]  # number of open picture encoders of each codec, by its name


def growth_alike(samples: Sequence[Sample]) -> float | None:
    """Return the growth as in `growth`, between moments with the same encoders open; None if there are no two such.

    An encoder takes ten megabytes, and the number of open ones depends on the present state of the network and the
    machine. So the first third after the warm-up is compared with the last, for each set of encoders that both have;
    sets weigh as often as both had them.
    """
    warm = samples[int(len(samples) * WARM_UP) :]
    size = len(warm) // 3
    early, late = _by_encoders(warm[:size]), _by_encoders(warm[len(warm) - size :])
    weights = {each: min(len(early[each]), len(late[each])) for each in early.keys() & late.keys()}
    weights = {each: weight for each, weight in weights.items() if weight >= ALIKE}
    if not weights:
        return None
    ratios = sum(weight * median(late[each]) / median(early[each]) for each, weight in weights.items())
    return ratios / sum(weights.values()) - 1


def _by_encoders(samples: Sequence[Sample]) -> dict[tuple[tuple[str, int], ...], list[float]]:
    found: dict[tuple[tuple[str, int], ...], list[float]] = defaultdict(list)
    for sample in samples:
        found[sample.encoders].append(sample.resident)
    return found


def growth(samples: Sequence[float]) -> float | None:
    """Return the relative growth from the beginning to the end of a life, after the warm-up; None for too few samples.

    Medians of the two ends are compared, so that a moment with more or fewer observers does not count.
    """
    warm = samples[int(len(samples) * WARM_UP) :]
    size = int(len(warm) * WINDOW)
    if size < 1:
        return None
    return median(warm[-size:]) / median(warm[:size]) - 1
