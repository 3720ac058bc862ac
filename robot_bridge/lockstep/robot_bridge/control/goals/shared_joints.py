"""Which goal axes move the same joints: a pose's, and those that it stands in for. No I/O."""

from collections.abc import Sequence

from lockstep.protocol.description import Axis, Pose

__all__ = ["SharedJoints"]


class SharedJoints:
    """The sets of axes that exclude each other.

    Attributes:
        rivals: for each axis of a set, the axes that must not be driven at the same time
        mates: for each such axis, the axes of its own set or sets, itself included
    """

    def __init__(self, axes: Sequence[Axis], poses: Sequence[Pose]) -> None:
        """`poses`: of a description that was checked."""
        index = {axis.name: number for number, axis in enumerate(axes)}
        self.rivals: dict[int, set[int]] = {}
        self.mates: dict[int, set[int]] = {}
        sets = [
            (
                {index[name] for name in (*pose.position, *pose.rotation) if name},
                {index[name] for name in pose.instead_of},
            )
            for pose in poses
        ]
        for own, others in sets:
            for mates, rivals in ((own, others), (others, own)):
                for number in mates:
                    self.mates.setdefault(number, set()).update(mates)
                    self.rivals.setdefault(number, set()).update(rivals)
        for own, others in sets:
            for number in own:  # two poses of one arm
                self.rivals[number].update(*(each for each, joints in sets if each is not own and joints & others))

    def conflict(self, values: Sequence[float | None]) -> tuple[int, int] | None:
        """Return two axes with numbers that exclude each other; None if there are none."""
        for number, rivals in self.rivals.items():
            if values[number] is not None:
                for rival in rivals:
                    if values[rival] is not None:
                        return number, rival
        return None
