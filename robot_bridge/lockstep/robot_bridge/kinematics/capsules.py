"""Capsules around the parts of an arm, and which of them must keep off each other. No I/O."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.clearance import Capsule, nearest_places

__all__ = ["capsule_around", "separate_pairs"]

Array = npt.NDArray[np.float64]
MOST_PAIRS: Final = 24  # the nearest ones; each costs time in every tick


def separate_pairs(
    chain: Chain,
    capsules: Mapping[str, Capsule],
    joints: Sequence[float],
    may_touch: Callable[[str, str], bool] = lambda one, other: True,
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of bodies that must not touch.

    Parts between which there is one joint touch there always. Those are left out too whose capsules, which hold more
    than the parts, meet at these joint positions, and those that cannot touch (`may_touch`) in the robot's own view.
    """
    state = chain.at(joints)
    ends = {}
    for body, capsule in capsules.items():
        start, end = chain.point(body, capsule.start), chain.point(body, capsule.end)
        ends[body] = (start.moving, chain.place(state, start), chain.place(state, end))

    def gap(one: str, other: str) -> float:
        (_, a, b), (_, c, d) = ends[one], ends[other]
        s, t = nearest_places(a, b, c, d)
        return math.dist(a + s * (b - a), c + t * (d - c)) - capsules[one].radius - capsules[other].radius

    found = sorted(
        (distance, one, other)
        for one, other in itertools.combinations(capsules, 2)
        if abs(ends[one][0] - ends[other][0]) > 1 and may_touch(one, other) and (distance := gap(one, other)) > 0.0
    )
    return tuple((one, other) for _, one, other in found[:MOST_PAIRS])


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


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)
