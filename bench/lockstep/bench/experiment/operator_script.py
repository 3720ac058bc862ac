"""A scripted operator who moves freely at varying rates: seeded, the same moves at the same times. No I/O."""

import math
from collections.abc import Sequence
from random import Random
from typing import NamedTuple

from lockstep.protocol.description import Axis
from lockstep.protocol.neutral import neutral_values

__all__ = ["Move", "OperatorScript"]

PHASE_SECONDS = (0.8, 2.5)
INTERVALS = (0.04, 0.5)  # s between two commands: 25 to 2 a second
PAUSE_SHARE = 0.15  # of the phases, in which the stick is let go
REACH = 0.6  # of an axis' limit
GOAL_REACH = 0.3  # of a goal axis' reach, around where it was: between two goals there is less than the reach


class Move(NamedTuple):
    """The operator's move at a time."""

    values: list[float | None]  # one per axis, in its unit; None: a goal axis stays
    interval: float  # s until the next command, at least
    pause: bool  # the stick is let go


class OperatorScript:
    """The moves of a script. Call `at` with times that do not decrease.

    Goal axes move within reach around where they were at first, and anew around where they are when something else has
    moved them far away.
    """

    def __init__(self, axes: Sequence[Axis], seed: int) -> None:
        self._axes = tuple(axes)
        self._random = Random(seed)
        self._until = 0.0
        self._move = Move(neutral_values(axes), INTERVALS[1], pause=True)
        self._homes: dict[int, float] = {}  # of goal axes, by number

    def at(self, elapsed: float, goals: Sequence[float | None] = ()) -> Move:
        """Return the move `elapsed` s after the script began.

        Args:
            goals: the applied goals of the newest feedback; where one is not known, the axis stays
        """
        while elapsed >= self._until:
            self._until += self._random.uniform(*PHASE_SECONDS)
            self._move = self._next()
        return self._move._replace(values=self._around_homes(self._move, goals))

    def _around_homes(self, move: Move, goals: Sequence[float | None]) -> list[float | None]:
        values = list(move.values)
        for number, axis in enumerate(self._axes):
            if axis.kind == "rate":
                continue
            goal = goals[number] if number < len(goals) else None
            if goal is not None and abs(goal - self._homes.get(number, math.inf)) > axis.reach / 2:
                self._homes[number] = goal
            offset, home = values[number], self._homes.get(number)
            values[number] = None if offset is None or home is None else _within(axis, home + offset)
        return values

    def _next(self) -> Move:
        interval = math.exp(self._random.uniform(*map(math.log, INTERVALS)))
        values = [self._value(axis) for axis in self._axes]
        if self._random.random() < PAUSE_SHARE:
            return Move(neutral_values(self._axes), INTERVALS[1], pause=True)
        return Move([*values], interval, pause=False)

    def _value(self, axis: Axis) -> float:
        """Return the value of a rate axis, or how far a goal axis is to be from its home."""
        share = self._random.uniform(-REACH, REACH)
        if axis.kind == "goal":
            return share / REACH * GOAL_REACH * axis.reach
        return axis.rest + share * ((axis.maximum if share > 0 else 2 * axis.rest - axis.minimum) - axis.rest)


def _within(axis: Axis, goal: float) -> float:
    return goal if axis.wrap else min(max(goal, axis.minimum), axis.maximum)
