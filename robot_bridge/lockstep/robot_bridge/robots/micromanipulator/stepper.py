"""A linear drive that moves in whole steps of 32 nm."""

import math
from typing import Final

__all__ = ["STEP", "Stepper"]

STEP: Final = 32e-9  # m
TIME_CONSTANT: Final = 0.04  # s over which the speed is measured: single steps are not a speed


class Stepper:
    """Turns velocities into whole steps; a fraction of a step waits for the next tick.

    Attributes:
        steps: position of the drive, in steps from its zero
        rate: steps per second, either way, as a mean over some hundredths of a second
        speed: m/s, as such a mean
    """

    def __init__(self, position: float) -> None:
        self.steps = round(position / STEP)
        self.rate = 0.0
        self.speed = 0.0
        self._rest = 0.0  # fraction of a step not made yet

    @property
    def position(self) -> float:
        """The position in m from the drive's zero."""
        return self.steps * STEP

    def tick(self, velocity: float, seconds: float) -> None:
        """Move at `velocity` (m/s) for `seconds`."""
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
