"""Finds the capsules around the parts of a model's arm that can collide."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.capsules import capsule_around
from lockstep.robot_bridge.kinematics.clearance import Capsule
from lockstep.robot_bridge.kinematics.surfaces import box_points, rod
from lockstep.robot_bridge.robots.mjcf.names import name_of

__all__ = ["capsules_of", "may_touch", "surface_points"]

Array = npt.NDArray[np.float64]
SPHERE, CAPSULE, CYLINDER, BOX, ELLIPSOID, MESH = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{shape}"))
    for shape in ("SPHERE", "CAPSULE", "CYLINDER", "BOX", "ELLIPSOID", "MESH")
)
RIM: Final = 12  # points around a cylinder's rim
CORNERS: Final = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
MOST_POINTS: Final = 400  # of a mesh


def capsules_of(model: Any, path: Sequence[int]) -> dict[str, Capsule]:
    """Return a capsule for each of these bodies that has shapes, by name. The world has none: it may be endless."""
    found = {}
    for body in filter(None, path):
        if spheres := list(_spheres(model, body)):
            found[name_of(model, "body", body)] = capsule_around(*map(np.array, zip(*spheres, strict=True)))
    return found


def may_touch(model: Any, one: str, other: str) -> bool:
    """Return whether the model lets two bodies collide."""
    bodies = [model.body(name).id for name in (one, other)]
    if any({int(pair) >> 16, int(pair) & 0xFFFF} == set(bodies) for pair in model.exclude_signature):
        return False
    types, affinities = (
        [_bits(model, body, flags) for body in bodies] for flags in (model.geom_contype, model.geom_conaffinity)
    )
    return bool(types[0] & affinities[1] or types[1] & affinities[0])


def surface_points(model: Any, geom: int) -> tuple[Array, float]:
    """Return places on a shape, n x 3, m in the geom's frame, and how far around them it reaches, m."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == CAPSULE:
        return rod(float(size[1])), float(size[0])
    if kind == CYLINDER:
        rim, _ = _hull(model, geom)
        return np.concatenate([rim[:RIM] * (1.0, 1.0, height) for height in (-1.0, -0.5, 0.0, 0.5, 1.0)]), 0.0
    points, radius = _hull(model, geom)
    if len(points) == len(CORNERS):  # a box, or what is taken as one
        middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
        return middle + box_points((points.max(axis=0) - middle).tolist()), radius
    return points, radius


def _spheres(model: Any, body: int) -> Iterator[tuple[Array, float]]:
    """Yield spheres whose hull holds all shapes of a body that can collide: centre in the body's frame, radius."""
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        points, radius = _hull(model, geom)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        for point in points @ turn.reshape(3, 3).T + model.geom_pos[geom]:
            yield point, radius


def _hull(model: Any, geom: int) -> tuple[Array, float]:
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind == CAPSULE:
        return np.array(((0.0, 0.0, size[1]), (0.0, 0.0, -size[1]))), float(size[0])
    if kind == CYLINDER:
        angles = np.arange(RIM) * (math.tau / RIM)
        wide = size[0] / math.cos(math.pi / RIM)  # so that the points' hull holds the circle
        rim = np.stack((np.cos(angles) * wide, np.sin(angles) * wide, np.full(RIM, size[1])), axis=1)
        return np.concatenate((rim, rim * (1.0, 1.0, -1.0))), 0.0
    if kind == MESH:
        mesh = int(model.geom_dataid[geom])
        begin, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        if count <= MOST_POINTS:
            return np.array(model.mesh_vert[begin : begin + count], dtype=np.float64), 0.0
    box = model.geom_aabb[geom]  # of a box, an ellipsoid, or a mesh with many points
    return box[:3] + CORNERS * box[3:], 0.0


def _bits(model: Any, body: int, flags: Any) -> int:
    first = int(model.body_geomadr[body])
    return int(np.bitwise_or.reduce(flags[first : first + int(model.body_geomnum[body])]))
