"""Poses: a position in m and an orientation as a quaternion w, x, y, z. No I/O."""

import math
from typing import NamedTuple

__all__ = ["Pose", "from_rpy"]

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Pose(NamedTuple):
    position: Vector = (0.0, 0.0, 0.0)
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)

    def then(self, inner: "Pose") -> "Pose":
        """Return the pose of a frame that has the pose `inner` in this one."""
        x, y, z = _turned(self.orientation, inner.position)
        px, py, pz = self.position
        return Pose((px + x, py + y, pz + z), _product(self.orientation, inner.orientation))

    @property
    def yaw(self) -> float:
        """The angle about z of this frame's x axis, rad."""
        x, y, _ = _turned(self.orientation, (1.0, 0.0, 0.0))
        return math.atan2(y, x)

    @property
    def upright(self) -> float:
        """The cosine of the angle between this frame's z axis and the outer one's; -1: upside down."""
        return _turned(self.orientation, (0.0, 0.0, 1.0))[2]


def from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the orientation of a URDF's `rpy`: about x, then y, then z of the outer frame, rad."""
    about_x = (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0)
    about_y = (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0)
    about_z = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
    return _product(about_z, _product(about_y, about_x))


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _turned(by: Quaternion, vector: Vector) -> Vector:
    w, x, y, z = by
    _, a, b, c = _product(_product(by, (0.0, *vector)), (w, -x, -y, -z))
    return a, b, c
