"""Shapes commanded axis values into applied ones: clamp, slew, hold, brake. No I/O, no clock.

Every value stays inside an envelope around its rest value that closes at the axis' `brake` rate and has closed `hold`
seconds after the last execution. So a command never outlives `hold`. A tick changes a value by no more than the rate
(`slew`, `brake`) times the period; where the envelope moves it, by no more than `brake` times the seconds since the
tick before.

That bounds the rate over periods, not between any two moments: where a command may begin the tick of its period
(`ticks_on_command`), two ticks, and so two steps of a ramp, may follow each other at once, and the next one come up to
two periods later. A limiter (position limits, geofences) has the last word.
"""

from collections.abc import Callable, Sequence

from lockstep.protocol.description import Axis

__all__ = ["AxisShaper", "Limiter"]

Limiter = Callable[[list[float], list[float]], list[float]]  # (values, values under braking) -> values nearer to rest


class AxisShaper:
    """The applied values of all axes.

    Call `drive` at execution, `rest` to come to rest early, and `step` or, after a failure, `brake` once a tick.
    """

    def __init__(self, axes: Sequence[Axis], *, hold: float, limiter: Limiter | None = None) -> None:
        self._axes = tuple(axes)
        self._hold = hold
        self._limiter = limiter
        self._rest_values = [axis.rest for axis in axes]
        self._values = list(self._rest_values)  # applied last, [0.4, 0.0, 0.0]
        self._targets: list[float] | None = None  # None: coming to rest or there
        self._deadline = float("-inf")  # s, when all values must be at rest

    @property
    def values(self) -> list[float]:
        """The values applied last."""
        return list(self._values)

    @property
    def at_rest(self) -> bool:
        """True if all applied values are at rest and none is to leave it."""
        return self._values == self._rest_values and self._targets in (None, self._rest_values)

    def drive(self, values: Sequence[float], now: float) -> None:
        """Aim for `values` (finite, one per axis), clamped to the axes' limits."""
        self._targets = [
            min(max(value, axis.minimum), axis.maximum) for value, axis in zip(values, self._axes, strict=True)
        ]
        self._deadline = now + self._hold

    def rest(self) -> None:
        """Come to rest at the brake rate from the next step on."""
        self._targets = None

    def brake(self, dt: float) -> list[float]:
        """Take one step towards rest at the brake rate, from any target, without asking the limiter."""
        self._targets = None
        self._values = self._braked(dt)
        return list(self._values)

    def cut(self) -> None:
        """Set the values to rest without a ramp, because the robot's motion meanwhile is unknown."""
        self._targets = None
        self._values = list(self._rest_values)

    def step(self, now: float, dt: float) -> list[float]:
        """Return the values for a tick of `dt` seconds that begins now."""
        left = self._deadline - now
        if left <= 0:
            self._targets = None
        values = [self._step_axis(index, axis, left, dt) for index, axis in enumerate(self._axes)]
        self._values = values if self._limiter is None else self._limiter(values, self._braked(dt))
        return list(self._values)

    def _step_axis(self, index: int, axis: Axis, left: float, dt: float) -> float:
        target, rate = (axis.rest, axis.brake) if self._targets is None else (self._targets[index], axis.slew)
        change = target - self._values[index]
        value = target if abs(change) <= rate * dt else self._values[index] + (rate * dt if change > 0 else -rate * dt)
        reach = axis.brake * max(left, 0.0)
        return min(max(value, axis.rest - reach), axis.rest + reach)

    def _braked(self, dt: float) -> list[float]:
        """Return the values after one step of braking from the last applied ones."""
        return [
            max(axis.rest, value - axis.brake * dt) if value > axis.rest else min(axis.rest, value + axis.brake * dt)
            for value, axis in zip(self._values, self._axes, strict=True)
        ]
