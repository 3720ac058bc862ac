"""Checks a description's position limits and geofences once, before the bridge listens."""

import math
from collections.abc import Iterable, Sequence

from lockstep.protocol.description import Geofence, PlanarBase, PositionLimit, RobotDescription
from lockstep.robot_bridge.errors import DescriptionError

__all__ = ["check_limits"]

MAX_LATENCY = 1.0  # s
MAX_CORNERS = 64  # of one geofence
MAX_ZONES = 32

Point = tuple[float, float]


def check_limits(description: RobotDescription) -> None:
    """Check the position limits, the planar base and the geofences.

    Raises:
        DescriptionError: names the first contradiction found.
    """
    axes = {axis.name for axis in description.axes}
    joints = {joint.name for joint in description.joints}
    for limit in description.position_limits:
        _check_position_limit(limit, axes, joints)
    if description.planar_base is not None:
        _check_base(description.planar_base, axes, joints)
    elif description.geofences:
        raise DescriptionError("geofences need planar_base, which says where the base's pose is measured")
    if len(description.geofences) > MAX_ZONES:
        raise DescriptionError(f"{len(description.geofences)} geofences, the bound is {MAX_ZONES}")
    for fence in description.geofences:
        _check_fence(fence)
    names = [limit.name for limit in description.position_limits] + [fence.name for fence in description.geofences]
    for index, name in enumerate(names):
        if not name or name in names[:index]:
            raise DescriptionError(f"limit name {name!r} is empty or used twice")


def _check_position_limit(limit: PositionLimit, axes: set[str], joints: set[str]) -> None:
    where = f"limit {limit.name}"
    _known("joint", (limit.joint,), joints, where)
    _known("axis", (each.axis for each in limit.axes), axes, where)
    _reserves(where, limit.margin, limit.latency)
    if not limit.axes or len({each.axis for each in limit.axes}) < len(limit.axes):
        raise DescriptionError(f"{where}: needs the axes that move the joint, each once")
    for each in limit.axes:
        if each.gain is not None and (not math.isfinite(each.gain) or each.gain == 0):
            raise DescriptionError(f"{where}: the gain of {each.axis} must be finite and not 0")
    if len({each.gain is None for each in limit.axes}) > 1:
        raise DescriptionError(f"{where}: either all gains are given, or none")
    if limit.minimum is None and limit.maximum is None:
        raise DescriptionError(f"{where}: needs a minimum or a maximum")
    bounds = [bound for bound in (limit.minimum, limit.maximum) if bound is not None]
    if not all(map(math.isfinite, bounds)):
        raise DescriptionError(f"{where}: every number must be finite")
    if len(bounds) == 2 and bounds[0] + limit.margin > bounds[1] - limit.margin:
        raise DescriptionError(f"{where}: the margin leaves no room between minimum and maximum")


def _check_base(base: PlanarBase, axes: set[str], joints: set[str]) -> None:
    _known("joint", (base.x, base.y, base.yaw), joints, "planar_base")
    moves = [name for name in (base.forward, base.left, base.turn) if name]
    _known("axis", (base.forward, *moves), axes, "planar_base")
    if len(set(moves)) < len(moves) or len({base.x, base.y, base.yaw}) < 3:
        raise DescriptionError("planar_base: an axis or a joint is named twice")
    _reserves("planar_base", base.margin, base.latency)
    if not (math.isfinite(base.radius) and base.radius >= 0):
        raise DescriptionError("planar_base: radius must not be negative")


def _check_fence(fence: Geofence) -> None:
    where = f"geofence {fence.name}"
    corners = fence.polygon
    if not 3 <= len(corners) <= MAX_CORNERS:
        raise DescriptionError(f"{where}: needs 3 to {MAX_CORNERS} corners, not {len(corners)}")
    if not all(math.isfinite(number) for corner in corners for number in corner):
        raise DescriptionError(f"{where}: every number must be finite")
    edges = [(corners[index - 1], corner) for index, corner in enumerate(corners)]
    if any(start == end for start, end in edges):
        raise DescriptionError(f"{where}: two successive corners are the same")
    for index, edge in enumerate(edges):
        for other in edges[:index]:
            if len({*edge, *other}) == 4 and _cross(edge, other):
                raise DescriptionError(f"{where}: its edges cross")
    if abs(sum(ax * by - bx * ay for (ax, ay), (bx, by) in edges)) < 1e-9:
        raise DescriptionError(f"{where} has no area")


def _cross(first: tuple[Point, Point], second: tuple[Point, Point]) -> bool:
    """Return whether two segments share a point; touching counts."""
    (a, b), (c, d) = first, second
    return _side(a, b, c) * _side(a, b, d) <= 0 and _side(c, d, a) * _side(c, d, b) <= 0 and _overlap(first, second)


def _side(a: Point, b: Point, p: Point) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _overlap(first: tuple[Point, Point], second: tuple[Point, Point]) -> bool:
    """Return whether the boxes around two segments overlap: segments on one line need not meet."""
    return all(
        max(min(first[0][k], first[1][k]), min(second[0][k], second[1][k]))
        <= min(max(first[0][k], first[1][k]), max(second[0][k], second[1][k]))
        for k in (0, 1)
    )


def _reserves(where: str, margin: float, latency: float) -> None:
    if not (math.isfinite(margin) and margin >= 0):
        raise DescriptionError(f"{where}: margin must not be negative")
    if not 0 <= latency <= MAX_LATENCY:
        raise DescriptionError(f"{where}: latency must be in [0, {MAX_LATENCY:g}] s, not {latency}")


def _known(kind: str, names: Iterable[str], known: Sequence[str] | set[str], where: str) -> None:
    for name in names:
        if name not in known:
            raise DescriptionError(f"{where} names the {kind} {name!r}, which is not described")
