"""Distances between parts of a robot, as capsules around its links, and how the joints change them."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.kinematics.chain import Chain, ChainPoint, ChainState, cross

__all__ = ["Capsule", "Clearance", "Gap", "GapSource", "nearest_places"]

Array = npt.NDArray[np.float64]
Vector = tuple[float, float, float]
TINY = 1e-12  # m², of a line that is a point


class Capsule(NamedTuple):
    """All points within `radius` of a line, in the frame of a body."""

    start: Vector  # m
    end: Vector  # m
    radius: float  # m


class Gap(NamedTuple):
    distance: float  # m, negative if they overlap
    gradient: Array  # m per rad (or m) of each joint
    what: str = "itself"  # that the arm is close to, "the table"


class GapSource(Protocol):
    """Knows what the robot must keep off.

    Attributes:
        levers: m per rad, how fast each distance changes at most when each joint does, distances x joints
    """

    @property
    def levers(self) -> Array: ...

    def widths(self, state: ChainState, within: float) -> Array:
        """Return each distance (m) that `levers` is about; one that is not below `within` (m) counts as `within`."""

    def gaps(self, state: ChainState, within: float, ahead: Array | None = None) -> list[Gap]:
        """Return the gaps that are narrower than `within` (m).

        `ahead`: rad or m, a motion of each joint: the gaps that it would make narrower than `within` are returned too.
        """


class Clearance:
    """Computes the gaps between pairs of bodies of a chain. The capsules should hold the bodies' parts entirely.

    Attributes:
        levers: of each pair, see `GapSource`
    """

    def __init__(self, chain: Chain, capsules: Mapping[str, Capsule], pairs: Sequence[tuple[str, str]]) -> None:
        """`capsules`: by body. `pairs`: of bodies that must not touch.

        Raises:
            NoChain: a body is not a part of the chain.
        """
        self._chain = chain
        names = list(capsules)
        self._ends = [
            (chain.point(name, capsule.start), chain.point(name, capsule.end)) for name, capsule in capsules.items()
        ]
        self._pairs = [
            (names.index(first), names.index(second), capsules[first].radius + capsules[second].radius)
            for first, second in pairs
        ]
        self._both = np.array([end.moving for each in self._ends for end in each], dtype=int)
        self._places = np.array([end.position for each in self._ends for end in each]).reshape(-1, 3, 1)
        self._columns = np.array([pair[:2] for pair in self._pairs], dtype=int).reshape(-1, 2).T
        reaches = np.array([math.dist(each.start, each.end) / 2 + each.radius for each in capsules.values()])
        self._reaches = reaches[self._columns].sum(axis=0)  # m, of both capsules around their middles
        radii = [each.radius for each in capsules.values()]
        levers = [self._levers(radii, pair) for pair in self._columns.T.tolist()]
        self.levers: Array = np.array(levers).reshape(-1, len(chain.joints))

    def gaps(self, state: ChainState, within: float, ahead: Array | None = None) -> list[Gap]:
        """Return the gaps of the pairs that are closer than `within` (m), or come so by the motion `ahead`."""
        if not self._pairs:
            return []
        ends = self._ends_at(state)
        closer = within if ahead is None else within + self._comes_closer(state, ends, ahead)
        gaps = (self._gap(state, self._pairs[number], ends, within, ahead) for number in self._near(ends, closer))
        return [gap for gap in gaps if gap is not None]

    def widths(self, state: ChainState, within: float) -> Array:
        """Return the distance of each pair, m; one that is not below `within` (m) counts as `within`."""
        widths = np.full(len(self._pairs), within)
        if self._pairs:
            ends = self._ends_at(state)
            for number in self._near(ends, within):
                first, second, radii = self._pairs[number]
                here, there = _nearest(ends[first], ends[second])
                widths[number] = min(within, math.dist(here, there) - radii)
        return widths

    def _levers(self, radii: Sequence[float], pair: Sequence[int]) -> Array:
        near, far = sorted(pair, key=lambda body: self._ends[body][0].moving)
        extent = max(math.hypot(*end.position) for end in self._ends[far]) + radii[far]
        return self._chain.levers(self._ends[near][0].moving, self._ends[far][0].moving, extent)

    def _ends_at(self, state: ChainState) -> Array:
        """Return where the capsules' ends are, m, capsules x 2 x 3."""
        places = state.places[self._both] + (state.turns[self._both] @ self._places)[:, :, 0]
        ends: Array = places.reshape(-1, 2, 3)
        return ends

    def _near(self, ends: Array, within: Array | float) -> list[int]:
        """Return the pairs whose capsules may be nearer than `within` (m, also one for each)."""
        middles = ends.mean(axis=1)
        apart = middles[self._columns[0]] - middles[self._columns[1]]
        near: list[int] = np.flatnonzero((apart * apart).sum(axis=1) < (self._reaches + within) ** 2).tolist()
        return near

    def _comes_closer(self, state: ChainState, ends: Array, ahead: Array) -> Array:
        """Return by how much two places of each pair come closer to each other at most, m."""
        ways, turns = self._chain.twists(state, ahead)
        motions = (ways[self._both] + cross(turns[self._both], ends.reshape(-1, 3))).reshape(-1, 2, 3)  # of the ends
        apart = motions[self._columns[0]][:, :, None] - motions[self._columns[1]][:, None, :]
        return np.sqrt((apart * apart).sum(axis=3).max(axis=(1, 2)))  # type: ignore[no-any-return]

    def _gap(
        self, state: ChainState, pair: tuple[int, int, float], ends: Array, within: float, ahead: Array | None
    ) -> Gap | None:
        first, second, radii = pair
        here, there = _nearest(ends[first], ends[second])
        apart = here - there
        length = math.sqrt(apart @ apart)
        is_near = length < radii + within
        if not is_near and ahead is None:
            return None
        if length <= TINY:  # the lines cross: no direction leads apart more than another
            return Gap(length - radii, np.zeros(state.linear.shape[1]))
        motion = self._motion(state, self._ends[first], here) - self._motion(state, self._ends[second], there)
        gap = Gap(length - radii, apart @ motion / length)
        return gap if is_near or (ahead is not None and gap.distance + float(gap.gradient @ ahead) < within) else None

    def _motion(self, state: ChainState, ends: tuple[ChainPoint, ChainPoint], place: Array) -> Array:
        return self._chain.motion(state, ends[0].moving, place)


def _nearest(one: Array, other: Array) -> tuple[Array, Array]:
    """Return where two lines, given by their ends (2 x 3, m), are nearest to each other."""
    (a, b), (c, d) = one, other
    s, t = nearest_places(a, b, c, d)
    return a + s * (b - a), c + t * (d - c)


def nearest_places(a: Array, b: Array, c: Array, d: Array) -> tuple[float, float]:
    """Return where the lines a-b and c-d are nearest to each other, as shares of their lengths.

    Ericson, "Real-Time Collision Detection", 5.1.9.
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv, uw, vw = float(u @ u), float(v @ v), float(u @ v), float(u @ w), float(v @ w)
    if uu <= TINY:
        return 0.0, 0.0 if vv <= TINY else _share(vw / vv)
    if vv <= TINY:
        return _share(-uw / uu), 0.0
    spread = uu * vv - uv * uv
    s = _share((uv * vw - uw * vv) / spread) if spread > TINY * uu * vv else 0.0
    t = (uv * s + vw) / vv
    if t < 0.0:
        return _share(-uw / uu), 0.0
    if t > 1.0:
        return _share((uv - uw) / uu), 1.0
    return s, t


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)
