"""What stands still around an arm: distances of the arm's surface from planes and boxes, and how joints change them.

The surface is a set of spheres for each body, most of them points. That is exact for corners against a plane, so a hand
may come as near to a table as it needs to. Against the edges of a box it is as exact as the spheres are dense.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.chain import Chain, ChainState, cross
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
    """Computes the gap between each body and each obstacle that is near it, if the joints change it.

    Attributes:
        levers: of each body and obstacle, the obstacles of a body after each other, see `GapSource`
    """

    def __init__(self, chain: Chain, surfaces: Mapping[str, Surface], obstacles: Sequence[Obstacle]) -> None:
        """`surfaces`: by body.

        Raises:
            NoChain: a body is not a part of the chain.
        """
        self._chain = chain
        self._bodies: list[tuple[int, Array, Array]] = []  # joints that move it, points in their frame (3 x n), radii
        middles, reaches = [], []  # of the balls that hold each: m, in the same frame; and their radii, m
        for name, surface in surfaces.items():
            places = [chain.point(name, point) for point in surface.points.tolist()]
            if places and places[0].moving:  # what no joint moves keeps its distance
                points = np.array([place.position for place in places])
                middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
                self._bodies.append((places[0].moving, np.ascontiguousarray(points.T), surface.radii))
                middles.append(middle)
                reaches.append(float((np.linalg.norm(points - middle, axis=1) + surface.radii).max()))
        self._obstacles = tuple(obstacles)
        self.levers = np.array(
            [self._levers(body, each) for body in self._bodies for each in self._obstacles], dtype=np.float64
        ).reshape(-1, len(chain.joints))
        self._changes = self.levers.any(axis=1).reshape(len(self._bodies), len(self._obstacles))
        self._moving = np.array([moving for moving, _, _ in self._bodies], dtype=int)
        self._middles = np.array(middles).reshape(-1, 3, 1)
        self._reaches = np.array(reaches)
        # Of all obstacles: the sides' directions in rows, and the middles seen along them.
        self._sides = np.array([each.rotation.T for each in self._obstacles]).reshape(-1, 3)
        self._offsets = np.array([each.position @ each.rotation for each in self._obstacles]).reshape(-1)
        self._halves = np.array([each.half for each in self._obstacles]).reshape(-1)

    def gaps(self, state: ChainState, within: float, ahead: Array | None = None) -> list[Gap]:
        """Return the gaps that are narrower than `within` (m), or become so by the motion `ahead` of the joints.

        Of each body and obstacle these are the narrowest and others. If the nearest place alone were kept off, the far
        end of a hand could come down fast about it.
        """
        if not self._bodies or not self._obstacles:
            return []
        twists = None if ahead is None else self._chain.twists(state, ahead)
        found: list[Gap] = []
        for body, obstacles in self._near(state, within, twists):
            for number in obstacles:
                found += self._between(state, body, self._obstacles[number], within, twists)
        return found

    def widths(self, state: ChainState, within: float) -> Array:
        """Return each distance of a body from an obstacle, m; one that is not below `within` (m) counts as `within`.

        So do those that no joint changes.
        """
        widths = np.full((len(self._bodies), len(self._obstacles)), within)
        if widths.size:
            for body, obstacles in self._near(state, within, None):
                for number in obstacles:
                    distances = self._seen(self._obstacles[number], state, body)[2]
                    widths[body, number] = min(within, float(distances.min()))
        return widths.reshape(-1)

    def _levers(self, body: tuple[int, Array, Array], obstacle: Obstacle) -> Array:
        moving, points, radii = body
        levers = self._chain.levers(0, moving, float((np.linalg.norm(points, axis=0) + radii).max()))
        if np.isinf(obstacle.half[:2]).all() and self._chain.turns_about(obstacle.rotation[:, 2]):
            levers[0] = 0.0  # the first joint turns the arm over a floor
        return levers

    def _between(
        self, state: ChainState, body: int, obstacle: Obstacle, within: float, twists: tuple[Array, Array] | None
    ) -> Iterator[Gap]:
        """Yield the gaps between a body and an obstacle. Places and ways are along the obstacle's sides, 3 x n."""
        moving, sides = self._bodies[body][0], obstacle.rotation.T
        places, beyond, distances = self._seen(obstacle, state, body)
        soon = distances
        outward = None
        if twists is not None:
            outward = _outward(places, beyond)
            way, (x, y, z) = sides @ twists[0][moving], (sides @ twists[1][moving]).tolist()
            spin = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
            ways = spin @ places + (way + spin @ (sides @ obstacle.position))[:, None]
            soon = distances + np.minimum((outward * ways).sum(axis=0), 0.0)
        for number in _spread(places, soon, within, APART * float(self._reaches[body])):
            one = slice(number, number + 1)
            out = (_outward(places[:, one], beyond[:, one]) if outward is None else outward[:, one])[:, 0]
            place = obstacle.position + obstacle.rotation @ places[:, number]
            motion = self._chain.motion(state, moving, place)
            yield Gap(float(distances[number]), (obstacle.rotation @ out) @ motion, obstacle.name)

    def _seen(self, obstacle: Obstacle, state: ChainState, body: int) -> tuple[Array, Array, Array]:
        """Return the places of a body's surface from an obstacle's middle along its sides, how far they are beyond
        these (m, 3 x n both), and their distances (m)."""
        moving, points, radii = self._bodies[body]
        begins = obstacle.rotation.T @ (state.places[moving] - obstacle.position)
        places = obstacle.rotation.T @ state.turns[moving] @ points + begins[:, None]
        beyond = np.abs(places) - obstacle.half[:, None]
        return places, beyond, _distances(beyond) - radii

    def _near(
        self, state: ChainState, within: float, twists: tuple[Array, Array] | None
    ) -> Iterator[tuple[int, list[int]]]:
        """Yield each body whose ball is near obstacles that joints bring nearer, and the numbers of these.

        One computation for all: most are far, every tick. The distance of a ball's middle is taken along the sides
        alone, which is never more than it is.
        """
        middles = state.places[self._moving] + (state.turns[self._moving] @ self._middles)[:, :, 0]
        reaches = self._reaches + within
        if twists is not None:
            spins = twists[1][self._moving]
            ways = twists[0][self._moving] + cross(spins, middles)
            reaches = (
                reaches + np.sqrt((ways * ways).sum(axis=1)) + np.sqrt((spins * spins).sum(axis=1)) * self._reaches
            )
        beyond = np.abs(middles @ self._sides.T - self._offsets) - self._halves  # bodies x (obstacles, 3)
        beyond = beyond.reshape(len(middles), -1, 3).max(axis=2)
        near = (beyond < reaches[:, None]) & self._changes
        for body in np.flatnonzero(near.any(axis=1)).tolist():
            yield body, np.flatnonzero(near[body]).tolist()


def _spread(places: Array, distances: Array, within: float, apart: float) -> Iterator[int]:
    """Yield the numbers of the nearest places (3 x n) that are `apart` (m) from each other."""
    left = distances
    for _ in range(MOST_PLACES):
        number = int(left.argmin())
        if not left[number] < within:
            return
        yield number
        away = places - places[:, number : number + 1]
        left = np.where((away * away).sum(axis=0) < apart * apart, np.inf, left)


def _distances(beyond: Array) -> Array:
    """Return how far places are outside of an obstacle; negative: inside. `beyond`: beyond its sides, 3 x n."""
    outside = np.maximum(beyond, 0.0)
    return np.sqrt((outside * outside).sum(axis=0)) + np.minimum(beyond.max(axis=0), 0.0)  # type: ignore[no-any-return]


def _outward(places: Array, beyond: Array) -> Array:
    """Return the directions in which places get away from an obstacle the fastest; all along its sides, 3 x n."""
    ways = np.maximum(beyond, 0.0)
    lengths = np.sqrt((ways * ways).sum(axis=0))
    inside = np.flatnonzero(lengths == 0.0)
    if len(inside):
        ways[beyond[:, inside].argmax(axis=0), inside] = lengths[inside] = 1.0
    outward: Array = np.copysign(ways / lengths, places)
    return outward
