"""Which values of a robot are `observation.state` and `action` of a LeRobot dataset, and their names. No I/O.

LeRobot names a joint's position `shoulder_pan.pos` and a speed `x.vel`. Unless somebody chooses, the action is one goal
or rate for each axis, without those of a pose that stands in for others; the state is the position of each joint, then
what is measured of the axes that no joint has.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.server.recording.errors import DatasetRefused
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord
from lockstep.server.recording.reading.event_rows import WRENCH

__all__ = ["DatasetLayout", "Extra", "LayoutChoice", "layout_of"]

Extra = Literal["wrench", "ranges"]
SUFFIXES = (".pos", ".vel")


class LayoutChoice(msgspec.Struct, frozen=True, kw_only=True):
    """What somebody chose. Names are those of the robot's axes, or of the dataset with `.pos` and `.vel`."""

    axes: list[str] = []  # of the action, in this order; empty: all but those of poses
    state: list[str] = []  # entries of the state, in this order; empty: joints, and the action's axes without a joint
    extras: list[Extra] = []  # columns of their own: observation.wrench, observation.ranges


class _Value(NamedTuple):
    """One number of a feedback."""

    name: str  # "shoulder_pan.pos"
    source: str  # of the axis or joint, as in `Feedback.unknown`
    unit: str
    is_joint: bool
    place: int  # in `Feedback.axes` or `.joints`


class DatasetLayout:
    """The chosen values, and how to take them from the records of an event.

    Raises:
        DatasetRefused: a chosen name is none of this robot's.
    """

    def __init__(self, description: RobotDescription, choice: LayoutChoice) -> None:
        self.choice = choice
        self._description = description
        axes, joints = _axis_values(description), _joint_values(description)
        self._action = _chosen(choice.axes, axes) if choice.axes else _without_poses(description, axes)
        measured = _unique([*joints, *self._action])
        known = _unique([*joints, *axes])
        self._state = _chosen(choice.state, known) if choice.state else measured
        self._stand_ins = _stand_ins(description)
        if not self._action or not self._state:
            raise DatasetRefused(f"{description.name} has no axis or no measured value for a dataset")
        if "wrench" in choice.extras and description.wrench is None:
            raise DatasetRefused(f"{description.name} has no force sensor")
        if "ranges" in choice.extras and description.ranges is None:
            raise DatasetRefused(f"{description.name} has no range sensors")

    @property
    def names(self) -> dict[str, list[str]]:
        """The names of each column's values."""
        names = {
            "observation.state": [value.name for value in self._state],
            "action": [value.name for value in self._action],
        }
        if "wrench" in self.choice.extras:
            names["observation.wrench"] = list(WRENCH)
        if "ranges" in self.choice.extras:
            count = self._description.ranges.count if self._description.ranges else 0
            names["observation.ranges"] = [str(number) for number in range(count)]
        return names

    @property
    def units(self) -> dict[str, str]:
        """The unit of each value of state and action, by name."""
        return {value.name: value.unit for value in (*self._state, *self._action)}

    def state(self, feedback: FeedbackRecord) -> dict[str, list[float]] | None:
        """Return the measured columns of a feedback; None where one of their values is not known."""
        columns = {"observation.state": _taken(self._state, feedback)}
        if "wrench" in self.choice.extras:
            columns["observation.wrench"] = feedback.wrench
        if "ranges" in self.choice.extras:
            columns["observation.ranges"] = feedback.ranges
        fits = all(len(columns[name]) == len(names) for name, names in self.names.items() if name in columns)
        unknown = set(feedback.unknown)
        return columns if fits and not any(value.source in unknown for value in self._state) else None

    def action(
        self, command: CommandRecord, answer: FeedbackRecord, after: FeedbackRecord | None
    ) -> list[float] | None:
        """Return the command's values; None where one of them is not known.

        A goal axis that is to stay has the goal where it stays, which its answer says. The joints that a pose moves
        have no goal of their own in the command: theirs is where the pose had brought them when the command ended,
        which the feedback `after` the answer says; None: there is none.
        """
        found = []
        for value in self._action:
            given = command.values[value.place] if value.place < len(command.values) else None
            if given is None:
                driven = any(_has(command.values, place) for place in self._stand_ins.get(value.place, ()))
                said = after if driven else answer
                given = said.goals[value.place] if said is not None and value.place < len(said.goals) else None
            if given is None:
                return None
            found.append(given)
        return found


def layout_of(description: RobotDescription, choice: LayoutChoice | None = None) -> DatasetLayout:
    """Return the layout. Raises DatasetRefused."""
    return DatasetLayout(description, choice or LayoutChoice())


def _taken(values: Sequence[_Value], feedback: FeedbackRecord) -> list[float]:
    sources = ((feedback.joints if value.is_joint else feedback.axes, value.place) for value in values)
    return [source[place] for source, place in sources if place < len(source)]


def _axis_values(description: RobotDescription) -> list[_Value]:
    return [
        _Value(_named(axis.name, ".pos" if axis.kind == "goal" else ".vel"), axis.name, axis.unit, False, place)
        for place, axis in enumerate(description.axes)
    ]


def _joint_values(description: RobotDescription) -> list[_Value]:
    return [
        _Value(_named(joint.name, ".pos"), joint.name, joint.unit, True, place)
        for place, joint in enumerate(description.joints)
    ]


def _named(name: str, suffix: str) -> str:
    return name if name.endswith(SUFFIXES) else name + suffix


def _unique(values: Sequence[_Value]) -> list[_Value]:
    found: dict[str, _Value] = {}
    for value in values:
        found.setdefault(value.name, value)
    return list(found.values())


def _without_poses(description: RobotDescription, axes: list[_Value]) -> list[_Value]:
    posed = {name for pose in description.poses if pose.instead_of for name in (*pose.position, *pose.rotation)}
    return [value for value in axes if value.source not in posed]


def _stand_ins(description: RobotDescription) -> dict[int, list[int]]:
    """Return the places of the pose axes that move what an axis moves, by the place of that axis."""
    place = {axis.name: number for number, axis in enumerate(description.axes)}
    found: dict[int, list[int]] = {}
    for pose in description.poses:
        axes = [place[name] for name in (*pose.position, *pose.rotation) if name in place]
        for name in pose.instead_of:
            found.setdefault(place[name], []).extend(axes)
    return found


def _chosen(names: Sequence[str], values: Sequence[_Value]) -> list[_Value]:
    """Raises DatasetRefused."""
    by_name = {value.source: value for value in values} | {value.name: value for value in values}
    unknown = [name for name in names if name not in by_name]
    if unknown:
        known = ", ".join(value.name for value in values)
        raise DatasetRefused(f"there is no {', '.join(unknown)}; there are {known}")
    return _unique([by_name[name] for name in names])


def _has(values: Sequence[float | None], place: int) -> bool:
    return place < len(values) and values[place] is not None
