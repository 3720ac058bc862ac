"""Integrates joint velocities into the joint positions that arms take. No I/O, no clock."""

import math
from collections.abc import Sequence

__all__ = ["Setpoints"]


class Setpoints:
    """The setpoints of an arm. Call `begin` when motion begins, then `advance` once a tick.

    A setpoint never runs further ahead of its joint than `leads`, so that a blocked arm does not leap when it comes
    free.
    """

    def __init__(self, leads: Sequence[float]) -> None:
        """`leads`: rad or m, one per joint."""
        self._leads = list(leads)
        self._points: list[float] = []

    @property
    def points(self) -> list[float]:
        """The wanted joint positions; empty before the first motion."""
        return list(self._points)

    def begin(self, measured: Sequence[float]) -> None:
        """Begin a motion at the measured positions."""
        self._points = list(measured)

    def advance(self, velocities: Sequence[float], measured: Sequence[float], dt: float) -> None:
        """Let a tick pass. An unknown measured position (NaN) leaves its setpoint where it is."""
        self._points = [
            _near(point + velocity * dt, position, lead) if math.isfinite(position) else point
            for point, velocity, position, lead in zip(self._points, velocities, measured, self._leads, strict=True)
        ]

    def ahead(self, velocities: Sequence[float], horizon: float) -> list[float]:
        """Return the wanted joint positions `horizon` seconds from now."""
        return [point + velocity * horizon for point, velocity in zip(self._points, velocities, strict=True)]


def _near(point: float, position: float, lead: float) -> float:
    return min(max(point, position - lead), position + lead)
