"""How fast the gaps between a robot's parts, and to obstacles, may become narrower (Faverjon and Tournassoud 1987)."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.clearance import Gap

__all__ = ["GapLimits", "clipped", "gap_limits"]

Array = npt.NDArray[np.float64]

FLAT: Final = 1e-4  # m per rad (or m), of a gap that the joints do not change
MOST_TRIES: Final = 12  # to keep all gaps with rates that the joints can have now
KEPT: Final = 1e-6  # m/s, above what a gap allows


class GapLimits(NamedTuple):
    """The gaps are ordered by their width, the narrowest last. Rates are of the joints, rad/s or m/s."""

    gradients: Array  # m per rad (or m), gaps x joints
    steep: Array  # the lengths of the gradients
    most: Array  # m/s, at which each gap may become narrower
    what: tuple[str, ...]  # that is near

    def narrowed(self, rates: Array, besides: Sequence[int] = ()) -> int | None:
        """Return the gap that these rates narrow the most above what it allows; None if they keep to all.

        `besides`: gaps that are left out.
        """
        if not self.what:
            return None
        excess = self._excess(rates)
        excess[list(besides)] = -np.inf
        worst = int(excess.argmax())
        return worst if excess[worst] > KEPT else None

    def apart(self, rates: Array) -> tuple[Array, tuple[int, ...]]:
        """Take from the rates what narrows a gap faster than it allows. Return these rates, and the gaps."""
        if self.narrowed(rates) is None:
            return rates, ()
        near = []
        for number in range(len(self.what)):
            if self._above(number, rates) > KEPT:
                rates = self._kept(number, rates)
                near.append(number)
        return rates, tuple(near)

    def changed(self, rates: Array, lowest: Array, highest: Array, braked: Array) -> Array:
        """Return rates from `lowest` to `highest`, the nearest to `rates` that keep the gaps as well as they can.

        A joint that changes more slowly than the others might otherwise lead towards what the others lead away from.
        `braked`: what is left of the rates where all joints brake.
        """
        rates = clipped(rates, lowest, highest)
        for _ in range(MOST_TRIES):
            if (number := self.narrowed(rates)) is None:
                return rates
            rates = clipped(self._kept(number, rates), lowest, highest)
        brakes = float(self._excess(braked).max()) < float(self._excess(rates).max())
        return braked if brakes else rates

    def _excess(self, rates: Array) -> Array:
        """Return by how much these rates narrow each gap faster than it allows, m/s."""
        excess: Array = -(self.gradients @ rates) - self.most
        return excess

    def _above(self, number: int, rates: Array) -> float:
        return -float(self.gradients[number] @ rates) - float(self.most[number])

    def _kept(self, number: int, rates: Array) -> Array:
        """Return the nearest rates that narrow a gap as fast as it allows."""
        gradient: Array = self.gradients[number]
        return rates + gradient * (self._above(number, rates) / float(self.steep[number]) ** 2)


def gap_limits(gaps: Sequence[Gap], joints: int, gain: float, close: float) -> GapLimits:
    """Return the limits of gaps of a chain of so many joints.

    A gap becomes narrower by at most `gain` (1/s) times what it is wider than `close` (m). Gaps that no joint changes
    are left out.
    """
    if not gaps:
        return GapLimits(np.zeros((0, joints)), np.zeros(0), np.zeros(0), ())
    ordered = sorted(gaps, key=lambda gap: -gap.distance)
    gradients = np.array([gap.gradient for gap in ordered]).reshape(-1, joints)
    steep = np.sqrt((gradients * gradients).sum(axis=1))
    most = gain * (np.array([gap.distance for gap in ordered]) - close)
    what = tuple(gap.what for gap in ordered)
    if steep.min() <= FLAT:
        changes = steep > FLAT
        gradients, steep, most = gradients[changes], steep[changes], most[changes]
        what = tuple(name for name, kept in zip(what, changes.tolist(), strict=True) if kept)
    return GapLimits(gradients, steep, np.maximum(0.0, most), what)


def clipped(values: Array, lowest: Array | float, highest: Array | float) -> Array:
    """Return values within bounds. `numpy.clip` costs more for a handful of values."""
    within: Array = np.minimum(np.maximum(values, lowest), highest)
    return within
