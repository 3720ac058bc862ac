"""The recorded values of one episode, and how they fit a robot. No I/O."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

from lockstep.client.replay.errors import ReplayUnfit
from lockstep.protocol.description import Axis, RobotDescription

__all__ = ["FittedTrajectory", "Row", "Trajectory", "fit"]

SUFFIXES = {".pos": "goal", ".vel": "rate"}  # LeRobot's names, and the kind of axis that they are of
BEYOND = 0.01  # of an axis' range, by which a value may be outside of it: it is clamped


@dataclass(frozen=True)
class Trajectory:
    """The rows of one episode; names are those of the recording, in which a joint may be called `elbow.pos`.

    Attributes:
        times: s, of each row; they do not go down
        actions: a value per name for each row
        states: what was measured, a value per name for each row
        units: by name, where they are known
    """

    times: Sequence[float]
    action_names: Sequence[str]
    actions: Sequence[Sequence[float]]
    state_names: Sequence[str] = ()
    states: Sequence[Sequence[float]] = ()
    units: Mapping[str, str] = field(default_factory=dict)


class Row(NamedTuple):
    time: float  # s, from the first row
    values: dict[str, float]  # by axis
    state: dict[str, float]  # by goal axis, where it was measured


@dataclass(frozen=True)
class FittedTrajectory:
    """The rows, by the robot's axes."""

    rows: Sequence[Row]
    axes: Mapping[str, Axis]  # that are driven

    @property
    def start(self) -> dict[str, float]:
        """Where the goal axes were at the beginning."""
        first = self.rows[0]
        return {
            name: first.state.get(name, first.values[name]) for name, axis in self.axes.items() if axis.kind == "goal"
        }


def fit(trajectory: Trajectory, description: RobotDescription) -> FittedTrajectory:
    """Return the trajectory by the robot's axes.

    Raises:
        ReplayUnfit: there are no rows, their times are not finite or go down, a name is none of an axis, the units
            differ, or a value is not finite or out of an axis' range.
    """
    axes = {axis.name: axis for axis in description.axes}
    if not trajectory.actions:
        raise ReplayUnfit("the episode has no rows")
    _check_times(trajectory.times)
    driven = [_axis_of(name, axes) for name in trajectory.action_names]
    for name, axis in zip(trajectory.action_names, driven, strict=True):
        unit = trajectory.units.get(name, axis.unit)
        if unit != axis.unit:
            raise ReplayUnfit(f"{name} was recorded in {unit}, and {axis.name} of this robot is in {axis.unit}")
    measured = {
        place: shown.name
        for place, name in enumerate(trajectory.state_names)
        if (shown := _found(name, axes)) is not None and shown.kind == "goal" and shown in driven
    }
    rows = []
    for number, action in enumerate(trajectory.actions):
        values = {axis.name: value for axis, value in zip(driven, action, strict=True)}
        for axis in driven:
            _check(axis, values[axis.name], number)
        state = trajectory.states[number] if trajectory.states else ()
        places = {
            name: state[place]
            for place, name in measured.items()
            if place < len(state) and math.isfinite(state[place])  # else it was not measured
        }
        rows.append(Row(trajectory.times[number] - trajectory.times[0], values, places))
    return FittedTrajectory(rows, {axis.name: axis for axis in driven})


def _check_times(times: Sequence[float]) -> None:
    """Check that each row ends: one whose time compares with nothing would be driven for ever."""
    if not all(map(math.isfinite, times)):
        raise ReplayUnfit("the time of a row is not a number")
    if any(after < before for before, after in pairwise(times)):
        raise ReplayUnfit("the times of the rows go down")


def _axis_of(name: str, axes: Mapping[str, Axis]) -> Axis:
    axis = _found(name, axes)
    if axis is None:
        raise ReplayUnfit(f"the robot has no axis for {name}; it has {', '.join(axes)}")
    return axis


def _found(name: str, axes: Mapping[str, Axis]) -> Axis | None:
    if name in axes:
        return axes[name]
    for suffix, kind in SUFFIXES.items():
        axis = axes.get(name.removesuffix(suffix)) if name.endswith(suffix) else None
        if axis is not None and axis.kind == kind:
            return axis
    return None


def _check(axis: Axis, value: float, row: int) -> None:
    if not math.isfinite(value):
        raise ReplayUnfit(f"{axis.name} is not finite in row {row}")
    beyond = BEYOND * (axis.maximum - axis.minimum)
    if axis.wrap is None and not axis.minimum - beyond <= value <= axis.maximum + beyond:
        raise ReplayUnfit(
            f"{axis.name} goes from {axis.minimum:g} to {axis.maximum:g} {axis.unit}, and row {row} asks for {value:g}"
            ": another robot, or another unit?"
        )
