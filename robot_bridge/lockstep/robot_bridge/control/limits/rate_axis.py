"""Shapes one rate axis: the value that is applied says how fast to move. No I/O, no clock."""

from typing import Final

from lockstep.protocol.description import Axis

__all__ = ["RateAxis", "rest_rate"]


def rest_rate(axis: Axis) -> float:
    """Return the rate at which an axis does not move; that of a goal axis is the speed of its goal."""
    return 0.0 if axis.kind == "goal" else axis.rest


class RateAxis:
    """The applied value of an axis that is driven by rates.

    `AxisShaper` calls, for each tick, `next_rate`, then `take` with the rate that the limits have left of it.
    """

    __slots__ = ("_brake", "_maximum", "_minimum", "_slew", "_target", "is_driven", "rate", "rest_rate")

    is_known: Final = True  # a rate needs no measured place
    applied_goal: Final = None

    def __init__(self, axis: Axis) -> None:
        self._minimum, self._maximum = axis.minimum, axis.maximum
        self._slew, self._brake = axis.slew, axis.brake
        self._target = axis.rest
        self.rest_rate = axis.rest  # the rate at which the axis does not move
        self.rate = axis.rest  # applied last, 0.4 m/s
        self.is_driven = False  # a target holds, and leads away from rest

    @property
    def value(self) -> float:
        """The value that the robot gets."""
        return self.rate

    @property
    def stands(self) -> bool:
        """True if the axis is at rest."""
        return self.rate == self.rest_rate

    def drive(self, value: float | None, speed: float) -> None:
        """Aim for a value, clamped to the axis' limits; None: for rest. `speed` concerns goal axes only."""
        rest = self.rest_rate
        self._target = rest if value is None else min(max(value, self._minimum), self._maximum)
        self.is_driven = self._target != rest

    def next_rate(self, left: float, dt: float, released: bool) -> float:
        """Return the rate that is wanted for a tick of `dt` s, `left` s before the axis has to be at rest.

        `released`: it comes to rest at its brake rate.
        """
        rate, rest = self.rate, self.rest_rate
        if released and rate == rest:
            return rate
        target, step = (rest, self._brake * dt) if released else (self._target, self._slew * dt)
        change = target - rate
        wanted = rate + step if change > step else rate - step if change < -step else target
        reach = self._brake * left if left > 0.0 else 0.0
        return min(max(wanted, rest - reach), rest + reach)

    def braked(self, dt: float) -> float:
        """Return the rate after one tick of braking."""
        rate, rest, step = self.rate, self.rest_rate, self._brake * dt
        return max(rest, rate - step) if rate > rest else min(rest, rate + step)

    def take(self, rate: float, dt: float) -> float:
        """Apply a rate for a tick of `dt` s; return the value that the robot gets."""
        self.rate = rate
        return rate

    def cut(self) -> None:
        """Be at rest at once."""
        self.rate = self.rest_rate

    def take_back(self) -> None:
        """Undo the motion of the last `take`: a rate has none."""

    def reaches(self, place: float, goal: float) -> bool:
        """Return True: a rate has no reach."""
        return True

    def begin(self, place: float) -> None:
        """Begin at a place: nothing to do for a rate."""
