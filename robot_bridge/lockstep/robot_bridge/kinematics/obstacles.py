"""What stands still around an arm: distances of the arm's surface from planes and boxes, and how joints change them.

The surface is a set of spheres for each body, most of them points. That is exact for corners against a plane, so a hand
may come as near to a table as it needs to. Against the edges of a box it is as exact as the spheres are dense.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.chain import Chain, ChainState
from lockstep.robot_bridge.kinematics.clearance import Gap

__all__ = ["Obstacle", "Obstacles", "Surface", "plane"]

Array = npt.NDArray[np.float64]
DEEP: Final = 1e3  # m, half of what is behind a plane: nothing of an arm is nearer to its other side
MOST_PLACES: Final = 4  # of a body that are kept off one obstacle at once: the corners of a hand
APART: Final = 0.4  # of a body's radius, at least, between two of these places


class Surface(NamedTuple):
    """Spheres whose hull is about a body, in the body's frame."""

    points: Array  # m, n x 3
    radii: Array  # m, n


class Obstacle(NamedTuple):
    """A box, in the frame of the chain's base. An endless half of it makes a plane."""

    name: str  # as in "the arm is close to …"
    position: Array  # m, of its middle
    rotation: Array  # 3 x 3
    half: Array  # m, half of its sizes; inf: endless that way


def plane(name: str, point: Sequence[float], normal: Sequence[float]) -> Obstacle:
    """Return what is endless behind a plane. `normal`: away from it, of any length.

    Raises:
        ValueError: the normal has no direction.
    """
    away = np.array(normal, dtype=np.float64)
    length = float(np.sqrt(away @ away))
    if not 0.0 < length < np.inf:
        raise ValueError(f"{tuple(normal)} is no direction")
    z = away / length
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.sqrt(x @ x)
    turn = np.stack((x, np.cross(z, x), z), axis=1)
    return Obstacle(name, np.array(point, dtype=np.float64) - DEEP * z, turn, np.array((np.inf, np.inf, DEEP)))


class Obstacles:
    """Computes the gap between each body and each obstacle that is near it."""

    def __init__(self, chain: Chain, surfaces: Mapping[str, Surface], obstacles: Sequence[Obstacle]) -> None:
        """`surfaces`: by body.

        Raises:
            NoChain: a body is not a part of the chain.
        """
        self._chain = chain
        self._bodies: list[tuple[int, Array, Array]] = []  # joints that move it, points in their frame, radii
        self._balls: list[tuple[Array, float]] = []  # that hold each: middle, in the same frame, and radius, m
        for name, surface in surfaces.items():
            places = [chain.point(name, point) for point in surface.points.tolist()]
            if places and places[0].moving:  # what no joint moves keeps its distance
                points = np.array([place.position for place in places])
                middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
                reach = float((np.linalg.norm(points - middle, axis=1) + surface.radii).max())
                self._bodies.append((places[0].moving, points, surface.radii))
                self._balls.append((middle, reach))
        self._obstacles = tuple(obstacles)

    def gaps(self, state: ChainState, within: float) -> list[Gap]:
        """Return the gaps that are narrower than `within` (m): the narrowest of each body and obstacle, and others.

        If the nearest place alone were kept off, the far end of a hand could come down fast about it.
        """
        found = []
        for (moving, points, radii), (middle, reach) in zip(self._bodies, self._balls, strict=True):
            turn, origin = state.turns[moving], state.places[moving]
            centre = (origin + turn @ middle)[None]
            near = [each for each in self._obstacles if _distances(each, centre)[0] - reach < within]
            if not near:
                continue
            places = origin + points @ turn.T
            for obstacle in near:
                distances = _distances(obstacle, places) - radii
                for number in _spread(places, distances, within, APART * reach):
                    place = places[number]
                    motion = self._chain.motion(state, moving, place)
                    found.append(Gap(float(distances[number]), _outward(obstacle, place) @ motion, obstacle.name))
        return found


def _spread(places: Array, distances: Array, within: float, apart: float) -> Iterator[int]:
    """Yield the numbers of the nearest places that are `apart` (m) from each other."""
    left = np.where(distances < within, distances, np.inf)
    for _ in range(MOST_PLACES):
        number = int(np.argmin(left))
        if not left[number] < within:
            return
        yield number
        away = places - places[number]
        left = np.where((away * away).sum(axis=1) < apart * apart, np.inf, left)


def _distances(obstacle: Obstacle, places: Array) -> Array:
    """Return how far places are outside of an obstacle; negative: inside."""
    beyond = np.abs((places - obstacle.position) @ obstacle.rotation) - obstacle.half
    outside = np.maximum(beyond, 0.0)
    return np.sqrt((outside * outside).sum(axis=1)) + np.minimum(beyond.max(axis=1), 0.0)  # type: ignore[no-any-return]


def _outward(obstacle: Obstacle, place: Array) -> Array:
    """Return the direction in which a place gets away from an obstacle the fastest."""
    own = (place - obstacle.position) @ obstacle.rotation
    beyond = np.abs(own) - obstacle.half
    way = np.maximum(beyond, 0.0)
    if not way.any():
        way[int(np.argmax(beyond))] = 1.0
    way = np.copysign(way, own)
    return obstacle.rotation @ (way / np.sqrt(way @ way))  # type: ignore[no-any-return]
