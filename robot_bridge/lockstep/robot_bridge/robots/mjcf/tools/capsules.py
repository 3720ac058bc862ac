"""Finds the capsules around the parts of an arm that the model lets collide, and which of them may touch.

Parts between which there is one joint touch there always. Of the others, those are left out that the model lets pass
through each other, and those whose capsules, which hold more than the parts, meet where the model begins.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.clearance import Capsule, nearest_places
from lockstep.robot_bridge.robots.mjcf.names import name_of

__all__ = ["Parts", "capsule_around", "parts_of"]

Array = npt.NDArray[np.float64]
SPHERE, CAPSULE, CYLINDER, BOX, ELLIPSOID, MESH = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{shape}"))
    for shape in ("SPHERE", "CAPSULE", "CYLINDER", "BOX", "ELLIPSOID", "MESH")
)
RIM: Final = 12  # points around a cylinder's rim
MOST_POINTS: Final = 400  # of a mesh
MOST_PAIRS: Final = 24  # the nearest ones; each costs time in every tick


class Parts(NamedTuple):
    capsules: Mapping[str, Capsule]  # by body
    pairs: tuple[tuple[str, str], ...]  # of bodies that must not touch


class _Part(NamedTuple):
    body: int
    moving: int  # joints of the chain that move it
    capsule: Capsule


def parts_of(model: Any, data: Any, path: Sequence[int], joints: Sequence[int]) -> Parts:
    """Return the parts of an arm. `path`: its bodies, from the base's on. `joints`: the chain's, of the model.

    `data` has the model's first posture. The world is no part: a floor may be endless.
    """
    parts, moving = [], 0
    for body in path:
        first = int(model.body_jntadr[body])
        moving += sum(joint in joints for joint in range(first, first + int(model.body_jntnum[body])))
        spheres = list(_spheres(model, body)) if body else []
        if spheres:
            parts.append(_Part(body, moving, capsule_around(*map(np.array, zip(*spheres, strict=True)))))
    apart = sorted(
        (gap, one, other)
        for one, other in itertools.combinations(range(len(parts)), 2)
        if abs(parts[one].moving - parts[other].moving) > 1
        and _may_touch(model, parts[one].body, parts[other].body)
        and (gap := _gap(data, parts[one], parts[other])) > 0.0
    )
    pairs = tuple((name_of(model, "body", parts[a].body), name_of(model, "body", parts[b].body)) for _, a, b in apart)
    capsules = {name_of(model, "body", part.body): part.capsule for part in parts}
    return Parts(capsules, pairs[:MOST_PAIRS])


def capsule_around(points: Array, radii: Array) -> Capsule:
    """Return a capsule that holds all spheres (n x 3, and n; m), the smallest of a few directions."""
    candidates = [*np.eye(3)]
    if len(points) > 1:
        candidates.append(np.linalg.svd(points - points.mean(axis=0))[2][0])
    return min((_along(axis, points, radii) for axis in candidates), key=_volume)


def _along(axis: Array, points: Array, radii: Array) -> Capsule:
    heights = points @ axis
    flat = points - np.outer(heights, axis)
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    middle -= (middle @ axis) * axis
    away = np.linalg.norm(flat - middle, axis=1)
    radius = float((away + radii).max())
    rounding = np.sqrt(np.maximum((radius - radii) ** 2 - away**2, 0.0))  # how far an end's half sphere reaches further
    begin, end = float((heights + rounding).min()), float((heights - rounding).max())
    if begin > end:
        begin = end = (begin + end) / 2.0
    return Capsule(_vector(middle + begin * axis), _vector(middle + end * axis), radius)


def _volume(capsule: Capsule) -> float:
    return capsule.radius**2 * (math.dist(capsule.start, capsule.end) + 4.0 / 3.0 * capsule.radius)


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
    return box[:3] + np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * box[3:], 0.0


def _may_touch(model: Any, one: int, other: int) -> bool:
    if any({int(pair) >> 16, int(pair) & 0xFFFF} == {one, other} for pair in model.exclude_signature):
        return False
    kinds = [
        (_bits(model, body, model.geom_contype), _bits(model, body, model.geom_conaffinity)) for body in (one, other)
    ]
    return bool(kinds[0][0] & kinds[1][1] or kinds[1][0] & kinds[0][1])


def _bits(model: Any, body: int, flags: Any) -> int:
    first = int(model.body_geomadr[body])
    return int(np.bitwise_or.reduce(flags[first : first + int(model.body_geomnum[body])]))


def _gap(data: Any, one: _Part, other: _Part) -> float:
    (a, b), (c, d) = (_ends(data, part) for part in (one, other))
    s, t = nearest_places(a, b, c, d)
    return math.dist(a + s * (b - a), c + t * (d - c)) - one.capsule.radius - other.capsule.radius


def _ends(data: Any, part: _Part) -> tuple[Array, Array]:
    turn, place = data.xmat[part.body].reshape(3, 3), data.xpos[part.body]
    return place + turn @ part.capsule.start, place + turn @ part.capsule.end


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)
