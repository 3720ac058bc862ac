"""Which values of a trajectory are due, and whether the robot follows. No I/O; the caller says what time it is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from lockstep.client.pipe.reach import within_reach
from lockstep.client.replay.errors import ReplayDeviated, ReplayTooFar, ReplayUnfit
from lockstep.client.replay.trajectory import FittedTrajectory, Row
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.protocol.neutral import neutral_values

__all__ = ["ReplayCore", "ReplayReport"]

HELD = 0.5  # s that a row's values are driven at most; then the robot waits for the next row
SETTLE = 0.3  # s after the last row, in which its values are still driven


@dataclass
class ReplayReport:
    """What happened.

    Attributes:
        rows: of the episode
        driven: rows that became a command; on a slow network others were skipped
        deviation: by axis, the largest distance of the measured state from the recorded one, in its unit
    """

    rows: int
    driven: int = 0
    deviation: dict[str, float] = field(default_factory=dict)


class ReplayCore:
    """One replay. Check `far` before, then drive `values` until it returns None, and tell each answer to `heard`.

    Args:
        pace: 1: as fast as it was recorded; below 1 slower

    Raises:
        ReplayUnfit: the pace is not a number above 0: the replay would never end.
    """

    def __init__(self, trajectory: FittedTrajectory, description: RobotDescription, pace: float = 1.0) -> None:
        if not 0.0 < pace < math.inf:
            raise ReplayUnfit(f"a pace is a number above 0, not {pace:g}")
        self._rows = trajectory.rows
        self._axes = trajectory.axes
        self._start = trajectory.start
        self._all = description.axes
        self._place = {axis.name: number for number, axis in enumerate(description.axes)}
        self._pace = pace
        self._current = -1
        self.report = ReplayReport(len(self._rows))

    def check_start(self, feedback: Feedback) -> None:
        """Raise ReplayTooFar when a goal axis is further than its reach from where the episode begins."""
        for name, start in self._start.items():
            axis, measured = self._axes[name], feedback.axes[self._place[name]]
            if not abs(_way(axis, measured, start)) <= axis.reach:  # a place that is not a number is not near
                raise ReplayTooFar(name, axis.unit, measured, start, axis.reach)

    def values(self, seconds: float, feedback: Feedback) -> list[float | None] | None:
        """Return the values to drive `seconds` after the begin, one per axis of the robot; None: it is over.

        The newest row that is due counts; rows that a slow network has held up are skipped, never made up for.
        """
        moment = seconds * self._pace
        if moment > self._rows[-1].time + SETTLE:
            return None
        before = self._current
        while self._current + 1 < len(self._rows) and self._rows[self._current + 1].time <= moment:
            self._current += 1
        self.report.driven += self._current != before
        row = self._rows[max(self._current, 0)]
        values = neutral_values(self._all)
        if moment - row.time > HELD * self._pace:
            return values
        for name, value in within_reach(self._all, feedback.axes, feedback.goals, row.values).items():
            values[self._place[name]] = value
        return values

    def heard(self, feedback: Feedback) -> None:
        """Take the answer to the values. Raises ReplayDeviated when the robot does not follow."""
        row = self._rows[max(self._current, 0)]
        for name, recorded in row.state.items():
            axis, measured = self._axes[name], feedback.axes[self._place[name]]
            distance = abs(_way(axis, measured, recorded))
            self.report.deviation[name] = max(self.report.deviation.get(name, 0.0), distance)
            if not distance <= axis.reach:  # a place that is not a number is no sign that the robot follows
                raise ReplayDeviated(name, axis.unit, measured, recorded)

    @property
    def start(self) -> dict[str, float]:
        """Where the goal axes were at the beginning, within their ranges."""
        return {
            name: value if self._axes[name].wrap is not None else _clamped(self._axes[name], value)
            for name, value in self._start.items()
        }

    @property
    def rows(self) -> Sequence[Row]:
        return self._rows


def _way(axis: Axis, measured: float, goal: float) -> float:
    way = goal - measured
    return way if axis.wrap is None or not math.isfinite(way) else math.remainder(way, axis.wrap)


def _clamped(axis: Axis, value: float) -> float:
    return min(max(value, axis.minimum), axis.maximum)
