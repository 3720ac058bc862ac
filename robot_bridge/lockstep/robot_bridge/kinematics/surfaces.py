"""Points on the shapes of a description's bodies, for `Obstacles`. No I/O."""

import itertools
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.protocol.description import Body, Geom
from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.obstacles import Surface
from lockstep.robot_bridge.kinematics.rotations import from_quaternion

__all__ = ["body_surfaces", "box_points", "joined", "rod"]

Array = npt.NDArray[np.float64]
ALONG: Final = (-1.0, -0.5, 0.0, 0.5, 1.0)  # of an edge, in halves of it: where the points are


def body_surfaces(bodies: Sequence[Body], chain: Chain) -> dict[str, Surface]:
    """Return the surfaces of a chain's bodies, by name.

    What hangs on them by joints that are not the chain's, such as a finger, counts as fixed, with its joints at zero.
    """
    known = {body.name: body for body in bodies}
    found: dict[str, list[Surface]] = {}
    for body in bodies:
        own = [_moved(_of(geom), geom.position, geom.orientation) for geom in body.geoms]
        name, seen = body.name, 0
        while name in known and not chain.has(name) and seen <= len(known):
            own = [_moved(surface, known[name].position, known[name].orientation) for surface in own]
            name, seen = known[name].parent, seen + 1
        if own and name and chain.has(name):
            found.setdefault(name, []).extend(own)
    return {name: joined(surfaces) for name, surfaces in found.items()}


def joined(surfaces: Iterable[Surface]) -> Surface:
    """Return one surface of several, in the same frame; at least one."""
    points, radii = zip(*surfaces, strict=True)
    return Surface(np.concatenate(points), np.concatenate(radii))


def box_points(half: Sequence[float]) -> Array:
    """Return points on a box around the origin, n x 3; `half`: m, half of its sizes."""
    grid = [each for each in itertools.product(ALONG, repeat=3) if max(map(abs, each)) == 1.0]
    return np.array(grid) * np.array(half)  # type: ignore[no-any-return]


def rod(half: float) -> Array:
    """Return points on a line along z around the origin, n x 3; `half`: m, half of its length."""
    return np.array([(0.0, 0.0, share * half) for share in ALONG])


def _of(geom: Geom) -> Surface:
    first, second, third = geom.size
    if geom.shape == "mesh":  # the box around it: its own corners may be far apart
        corners = np.array(geom.vertices).reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        points = box_points((high - low) / 2) + (low + high) / 2
        return Surface(points, np.zeros(len(points)))
    if geom.shape == "sphere":
        return Surface(np.zeros((1, 3)), np.array((first,)))
    if geom.shape == "capsule":
        points = rod(second)
        return Surface(points, np.full(len(points), first))
    points = box_points((first, first, second) if geom.shape == "cylinder" else (first, second, third))
    return Surface(points, np.zeros(len(points)))


def _moved(surface: Surface, position: Sequence[float], orientation: Sequence[float]) -> Surface:
    return Surface(surface.points @ from_quaternion(orientation).T + np.array(position), surface.radii)
