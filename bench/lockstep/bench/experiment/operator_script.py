"""A scripted operator who moves freely at varying rates: seeded, the same moves at the same times. No I/O."""

import math
from collections.abc import Sequence
from random import Random
from typing import NamedTuple

from lockstep.protocol.description import Axis

__all__ = ["Move", "OperatorScript"]

PHASE_SECONDS = (0.8, 2.5)
INTERVALS = (0.04, 0.5)  # s between two commands: 25 to 2 a second
PAUSE_SHARE = 0.15  # of the phases, in which the stick is let go
REACH = 0.6  # of an axis' limit


class Move(NamedTuple):
    """The operator's move at a time."""

    values: list[float]  # one per axis, in its unit
    interval: float  # s until the next command, at least
    pause: bool  # the stick is let go


class OperatorScript:
    """The moves of a script. Call `at` with times that do not decrease."""

    def __init__(self, axes: Sequence[Axis], seed: int) -> None:
        self._axes = tuple(axes)
        self._random = Random(seed)
        self._until = 0.0
        self._move = Move([axis.rest for axis in axes], INTERVALS[1], pause=True)

    def at(self, elapsed: float) -> Move:
        """Return the move `elapsed` s after the script began."""
        while elapsed >= self._until:
            self._until += self._random.uniform(*PHASE_SECONDS)
            self._move = self._next()
        return self._move

    def _next(self) -> Move:
        interval = math.exp(self._random.uniform(*map(math.log, INTERVALS)))
        values = [self._value(axis) for axis in self._axes]
        if self._random.random() < PAUSE_SHARE:
            return Move([axis.rest for axis in self._axes], INTERVALS[1], pause=True)
        return Move(values, interval, pause=False)

    def _value(self, axis: Axis) -> float:
        share = self._random.uniform(-REACH, REACH)
        return axis.rest + share * ((axis.maximum if share > 0 else 2 * axis.rest - axis.minimum) - axis.rest)
