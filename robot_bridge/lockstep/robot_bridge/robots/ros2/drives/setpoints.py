"""From joint velocities to joint positions, which is what arms take. No I/O, no clock."""

import math
from collections.abc import Sequence

__all__ = ["Setpoints"]


class Setpoints:
    """Call `begin` when motion begins, then `advance` once a tick.

    A setpoint never runs further ahead of its joint than `leads`, so that an arm that is blocked does not leap when
    it comes free.
    """

    def __init__(self, leads: Sequence[float]) -> None:
        """`leads`: rad or m, one per joint."""
        self._leads = list(leads)
        self._points: list[float] = []

    @property
    def points(self) -> list[float]:
        """Where the joints are wanted; empty before the first motion."""
        return list(self._points)

    def begin(self, measured: Sequence[float]) -> None:
        """Motion begins where the arm is."""
        self._points = list(measured)

    def advance(self, velocities: Sequence[float], measured: Sequence[float], dt: float) -> None:
        """Let a tick pass. A measured position that is not known (NaN) leaves its setpoint where it is."""
        self._points = [
            _near(point + velocity * dt, position, lead) if math.isfinite(position) else point
            for point, velocity, position, lead in zip(self._points, velocities, measured, self._leads, strict=True)
        ]

    def ahead(self, velocities: Sequence[float], horizon: float) -> list[float]:
        """Where the joints are wanted `horizon` seconds from now."""
        return [point + velocity * horizon for point, velocity in zip(self._points, velocities, strict=True)]


def _near(point: float, position: float, lead: float) -> float:
    return min(max(point, position - lead), position + lead)
