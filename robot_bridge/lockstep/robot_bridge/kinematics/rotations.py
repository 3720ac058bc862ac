"""Rotations as matrices, and as rotation vectors: the axis times the angle in rad (ROS calls it axis-angle)."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

__all__ = ["about_axis", "from_quaternion", "from_rotation_vector", "quaternion", "rotation_vector"]

Array = npt.NDArray[np.float64]

SMALL = 1e-8  # rad, below which a rotation has no axis that can be computed
NEARLY_HALF_A_TURN = 1e-4  # rad from it, where the antisymmetric part of the matrix vanishes


def about_axis(axis: Sequence[float], angle: float) -> Array:
    """Return the rotation by `angle` (rad) about a unit vector (Rodrigues' formula)."""
    x, y, z = axis
    sine, cosine = math.sin(angle), math.cos(angle)
    rest = 1.0 - cosine
    return np.array(
        (
            (cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine),
            (x * y * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine),
            (x * z * rest - y * sine, y * z * rest + x * sine, cosine + z * z * rest),
        )
    )


def from_quaternion(quaternion: Sequence[float]) -> Array:
    """Return the matrix of a quaternion w, x, y, z, which need not be of length 1.

    Raises:
        ValueError: its length is zero or not finite.
    """
    length = math.hypot(*quaternion)
    if not 0.0 < length < math.inf:
        raise ValueError(f"{tuple(quaternion)} is not a rotation")
    w, x, y, z = (part / length for part in quaternion)
    way = math.hypot(x, y, z)
    return np.eye(3) if way < SMALL else about_axis((x / way, y / way, z / way), 2.0 * math.atan2(way, w))


def from_rotation_vector(vector: Sequence[float]) -> Array:
    """Return the matrix of a rotation vector (rad); of any length."""
    x, y, z = vector
    angle = math.hypot(x, y, z)
    if angle < SMALL:
        return np.array(((1.0, -z, y), (z, 1.0, -x), (-y, x, 1.0)))
    return about_axis((x / angle, y / angle, z / angle), angle)


def rotation_vector(matrix: Array) -> Array:
    """Return the rotation vector (rad) of a rotation matrix; its length is at most pi."""
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    x, y, z = h - f, c - g, d - b  # twice the sine, times the axis
    sine, cosine = math.hypot(x, y, z) / 2.0, (a + e + i - 1.0) / 2.0
    angle = math.atan2(sine, cosine)
    if angle < SMALL:
        return np.array((x / 2.0, y / 2.0, z / 2.0))
    if math.pi - angle < NEARLY_HALF_A_TURN:
        # The symmetric part is 2 axis axis' - 1 there: its longest column has the axis, up to the sign.
        symmetric = (matrix + matrix.T) / 2.0 + np.eye(3)
        axis = symmetric[:, int(np.argmax(np.diag(symmetric)))]
        axis = axis / np.linalg.norm(axis)
        return axis * (-angle if axis @ (x, y, z) < 0.0 else angle)
    scale = angle / (2.0 * sine)
    return np.array((x * scale, y * scale, z * scale))


def quaternion(matrix: Array) -> tuple[float, float, float, float]:
    """Return the quaternion w, x, y, z of a rotation matrix, of length 1."""
    x, y, z = rotation_vector(matrix).tolist()
    angle = math.hypot(x, y, z)
    share = math.sin(angle / 2.0) / angle if angle > SMALL else 0.5
    return (math.cos(angle / 2.0), x * share, y * share, z * share)
