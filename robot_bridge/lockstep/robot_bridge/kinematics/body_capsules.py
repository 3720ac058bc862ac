"""Capsules around the shapes of a description's bodies. No I/O."""

import itertools
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import Body, Geom
from lockstep.robot_bridge.kinematics.capsules import capsule_around
from lockstep.robot_bridge.kinematics.clearance import Capsule
from lockstep.robot_bridge.kinematics.rotations import from_quaternion

__all__ = ["body_capsules"]

Array = npt.NDArray[np.float64]


def body_capsules(bodies: Iterable[Body]) -> dict[str, Capsule]:
    """Return a capsule that holds all shapes of a body, for each body that has shapes, by name."""
    found = {}
    for body in bodies:
        if spheres := [sphere for geom in body.geoms for sphere in _spheres(geom)]:
            found[body.name] = capsule_around(*map(np.array, zip(*spheres, strict=True)))
    return found


def _spheres(geom: Geom) -> Iterator[tuple[Array, float]]:
    """Yield spheres whose hull holds the shape: centre in the body's frame, radius."""
    points, radius = _hull(geom)
    for point in points @ from_quaternion(geom.orientation).T + np.array(geom.position):
        yield point, radius


def _hull(geom: Geom) -> tuple[Array, float]:
    first, second, third = geom.size
    if geom.shape == "mesh":
        return np.array(geom.vertices).reshape(-1, 3), 0.0
    if geom.shape == "sphere":
        return np.zeros((1, 3)), first
    if geom.shape == "capsule":
        return np.array(((0.0, 0.0, second), (0.0, 0.0, -second))), first
    half = (first, first, second) if geom.shape == "cylinder" else (first, second, third)  # the box around a cylinder
    return np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half, 0.0
