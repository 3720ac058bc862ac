"""A linear drive that moves in whole steps of 32 nm."""

import math
from typing import Final

__all__ = ["STEP", "Stepper"]

STEP: Final = 32e-9  # m
TIME_CONSTANT: Final = 0.04  # s over which the speed is measured: single steps are no speed


class Stepper:
    """Velocities in, whole steps out; a fraction of a step waits for the next tick.

    Attributes:
        steps: where the drive is, in steps from its zero
        rate: steps per second, either way, as a mean over some hundredths of a second
        speed: m/s, as such a mean
    """

    def __init__(self, position: float) -> None:
        self.steps = round(position / STEP)
        self.rate = 0.0
        self.speed = 0.0
        self._rest = 0.0  # of a step, not yet made

    @property
    def position(self) -> float:
        """m from its zero."""
        return self.steps * STEP

    def tick(self, velocity: float, seconds: float) -> None:
        """Go at `velocity` (m/s) for `seconds`."""
        if velocity:
            wanted = self._rest + velocity * seconds / STEP
            made = math.floor(wanted + 0.5)
            self._rest = wanted - made
            self.steps += made
        else:
            made, self._rest = 0, 0.0
        if made or self.speed:
            share = -math.expm1(-seconds / TIME_CONSTANT)
            self.speed += (made * STEP / seconds - self.speed) * share
            if not velocity and abs(self.speed) < STEP:  # less than a step a second
                self.speed = 0.0
        self.rate = abs(self.speed) / STEP
