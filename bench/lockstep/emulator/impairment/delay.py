"""Distributions of a packet's delay, given by their quantile function. No I/O.

A distribution turns one uniform number into one delay, so that every packet costs a seeded generator the same. All are
bounded: a delay is never below zero, and never above a `max` that was given.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Protocol

__all__ = ["NO_DELAY", "Constant", "Delay", "Lognormal", "Normal", "Pareto", "Uniform"]

STANDARD = NormalDist()
SMALLEST = 1e-12  # of a uniform number; its quantiles are finite
# Delays are fitted to what `ping` prints, and its largest of a hundred is about this quantile.
MAX_QUANTILE = 0.995
STEPS = 200  # of a bisection: more than a float has bits


class Delay(Protocol):
    """A distribution. Times are in seconds."""

    @property
    def mean(self) -> float: ...

    @property
    def max(self) -> float: ...

    def quantile(self, share: float) -> float:
        """Return the delay below which this share (0 to 1) of all packets stays."""


@dataclass(frozen=True)
class Constant:
    seconds: float

    @property
    def mean(self) -> float:
        return self.seconds

    @property
    def max(self) -> float:
        return self.seconds

    def quantile(self, share: float) -> float:
        return self.seconds


NO_DELAY = Constant(0.0)


@dataclass(frozen=True)
class Uniform:
    min: float
    max: float

    @property
    def mean(self) -> float:
        return (self.min + self.max) / 2

    def quantile(self, share: float) -> float:
        return self.min + share * (self.max - self.min)


class Normal:
    """A normal distribution, cut off at `min` and as far above the mean, so that the mean does not change."""

    def __init__(self, mean: float, deviation: float, min: float = 0.0) -> None:
        if not 0 <= min < mean or deviation <= 0:
            raise ValueError("normal needs 0 <= min < mean and deviation > 0")
        self.mean = mean
        self.max = 2 * mean - min
        self._normal = NormalDist(mean, deviation)
        self._low = self._normal.cdf(min)

    def quantile(self, share: float) -> float:
        inside = self._low + share * (1 - 2 * self._low)
        return _clamp(self._normal.inv_cdf(_open(inside)), 2 * self.mean - self.max, self.max)


class Lognormal:
    """A lognormal shifted to `min`, cut off at `max`, with exactly this mean: as of most pings' min/avg/max."""

    def __init__(self, min: float, mean: float, max: float) -> None:
        if not 0 <= min < mean < max:
            raise ValueError("lognormal needs 0 <= min < mean < max")
        self.min = min
        self.mean = mean
        self.max = max
        self._sigma = _sigma((max - min) / (mean - min))
        self._mu = self._fit(mean - min, math.log(max - min))
        self._inside = _below((math.log(max - min) - self._mu) / self._sigma)

    def _fit(self, mean: float, log_max: float) -> float:
        """Return the parameter with which the part below the cut has this mean."""
        low, high = math.log(mean) - 40 * self._sigma, log_max + 40 * self._sigma + 40
        for _ in range(STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if _cut_mean(middle, self._sigma, log_max) < mean else (low, middle)
        return (low + high) / 2

    def quantile(self, share: float) -> float:
        above = math.exp(self._mu + self._sigma * STANDARD.inv_cdf(_open(share * self._inside)))
        return _clamp(self.min + above, self.min, self.max)


def _sigma(ratio: float) -> float:
    """Return the sigma for which an uncut lognormal has `ratio` between the quantile of `max` and the mean, if any."""
    z = STANDARD.inv_cdf(MAX_QUANTILE)
    inside = z * z - 2 * math.log(ratio)
    return z - math.sqrt(inside) if inside > 0 else z


def _cut_mean(mu: float, sigma: float, log_max: float) -> float:
    """Return the mean of a lognormal's part below exp(log_max)."""
    cut = (log_max - mu) / sigma
    inside = _below(cut)
    if inside < 1e-300:
        return math.exp(log_max)
    return math.exp(mu + sigma * sigma / 2) * _below(cut - sigma) / inside


def _below(value: float) -> float:
    """Return the standard normal distribution; exact far below the mean, where `NormalDist.cdf` is 0."""
    return math.erfc(-value / math.sqrt(2)) / 2


class Pareto:
    """A bounded Pareto with exactly this mean: most packets near `min`, and a tail heavier than a lognormal's."""

    def __init__(self, min: float, mean: float, max: float) -> None:
        if not 0 < min < mean < max:
            raise ValueError("pareto needs 0 < min < mean < max")
        heaviest = (max - min) / math.log(max / min)
        if mean >= heaviest:
            raise ValueError(f"pareto with this min and max has a mean below {heaviest * 1000:.1f} ms")
        self.min = min
        self.mean = mean
        self.max = max
        low, high = 1e-9, 1e3
        for _ in range(STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if _pareto_mean(min, max, middle) > mean else (low, middle)
        self._alpha = (low + high) / 2
        self._ratio = 1 - (min / max) ** self._alpha

    def quantile(self, share: float) -> float:
        return _clamp(self.min * (1 - share * self._ratio) ** (-1 / self._alpha), self.min, self.max)


def _pareto_mean(low: float, high: float, alpha: float) -> float:
    if abs(alpha - 1) < 1e-9:
        return math.log(high / low) / (1 / low - 1 / high)
    ratio = low / high
    return alpha / (alpha - 1) * low * (1 - math.pow(ratio, alpha - 1)) / (1 - math.pow(ratio, alpha))


def _open(share: float) -> float:
    return _clamp(share, SMALLEST, 1 - SMALLEST)


def _clamp(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
