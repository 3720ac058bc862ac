"""Remembers each joint's state from JointState messages that may each name only some joints. No I/O, no clock."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

__all__ = ["BadJointState", "JointCache", "JointKnown", "JointStateMessage"]


class BadJointState(ValueError):
    """A message that contradicts itself; the text names the fault, for counting."""


class JointStateMessage(Protocol):
    """The fields of sensor_msgs/JointState that matter."""

    @property
    def name(self) -> Sequence[str]: ...
    @property
    def position(self) -> Sequence[float]: ...
    @property
    def velocity(self) -> Sequence[float]: ...


class JointKnown(NamedTuple):
    position: float = math.nan
    velocity: float = math.nan
    time: float = -math.inf  # s of its arrival, monotonic, suspended time included
    header: int = 0  # ns of its stamp


class JointCache:
    """The last known state of each joint. One thread writes it, another reads it: the tuple is replaced as a whole."""

    def __init__(self, names: Sequence[str]) -> None:
        self._index = {name: number for number, name in enumerate(names)}
        self._names = tuple(names)
        self._joints = (JointKnown(),) * len(names)

    def take(self, message: JointStateMessage, header: int, now: float) -> None:
        """Take in a message; joints with other names and repeated positions are passed over.

        Raises:
            BadJointState: the message contradicts itself.
        """
        if len(message.position) != len(message.name):
            raise BadJointState("joint states without one position per name")
        joints = list(self._joints)
        for at, name in enumerate(message.name):
            number = self._index.get(name)
            if number is None or (header != 0 and header == joints[number].header):
                continue
            position = float(message.position[at])
            if not math.isfinite(position):
                raise BadJointState("joint position that is not a number")
            velocity = float(message.velocity[at]) if at < len(message.velocity) else math.nan
            if not math.isfinite(velocity):
                velocity = _difference(joints[number], position, header, now)
            joints[number] = JointKnown(position, velocity, now, header)
        self._joints = tuple(joints)

    def fresh(self, timeout: float, now: float) -> list[JointKnown]:
        """Return the state of every joint; NaN for a joint whose state is older than `timeout`."""
        return [joint if now - joint.time <= timeout else JointKnown() for joint in self._joints]

    def missing(self, timeout: float, now: float) -> list[str]:
        """Return the names of the joints whose state is older than `timeout`."""
        return [name for name, joint in zip(self._names, self._joints, strict=True) if not now - joint.time <= timeout]


def _difference(before: JointKnown, position: float, header: int, now: float) -> float:
    """Return a joint's velocity from its last two positions, for a message without velocities."""
    span = (header - before.header) / 1e9 if header and before.header else now - before.time
    return (position - before.position) / span if 1e-4 < span < 1.0 else math.nan
