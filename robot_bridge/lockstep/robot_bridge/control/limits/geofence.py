"""Geofences: zones on the floor that a base stays inside of, or outside of. No I/O, no clock.

Each edge of a zone is a separate obstacle. The distance to a segment is a convex function of the place, so a motion by
`w` comes nearer to the edge by no more than the part of `w` that points from the base to the edge's nearest point.
Keeping that part below the room to each edge therefore keeps the base on its side of every edge, for zones of any
shape.

The base is treated as the circle that holds it, so turning on the spot is free. Turning while moving swings the motion
round: until the turn has ended, an axis may point anywhere within the angle that it still covers.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from lockstep.protocol.description import Geofence, PlanarBase, RobotDescription
from lockstep.robot_bridge.control.limits.stopping_distance import Demand, doubt, travel

__all__ = ["FenceGuard", "Zone"]

TOUCHING = 1e-9  # m; nearer than this, the direction to an edge is the one across it


class Nearest(NamedTuple):
    """A place on a zone's boundary as seen from the base: its distance, and the unit vector that points there."""

    distance: float
    nx: float
    ny: float


class Zone:
    """The edges of one geofence."""

    def __init__(self, fence: Geofence) -> None:
        self.name = fence.name
        self._keeps_in = fence.kind == "keep_in"
        corners = list(fence.polygon)
        area = sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True))
        if area < 0:
            corners.reverse()  # counter-clockwise: the inside is to the left of every edge
        self._edges = [
            (ax, ay, bx - ax, by - ay, math.hypot(bx - ax, by - ay))
            for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True)
        ]

    def look(self, x: float, y: float) -> tuple[bool, list[Nearest]]:
        """Return whether the place is on the permitted side, and the nearest place of every edge."""
        inside = False
        found: list[Nearest] = []
        for ax, ay, dx, dy, length in self._edges:
            px, py = x - ax, y - ay
            if (ay > y) != (ay + dy > y) and px < dx * py / dy:
                inside = not inside
            along = min(max((px * dx + py * dy) / (length * length), 0.0), 1.0)
            tx, ty = along * dx - px, along * dy - py
            distance = math.hypot(tx, ty)
            if distance > TOUCHING:
                found.append(Nearest(distance, tx / distance, ty / distance))
            else:
                out = 1.0 if self._keeps_in else -1.0
                found.append(Nearest(0.0, out * dy / length, -out * dx / length))
        return inside == self._keeps_in, found


class FenceGuard:
    """Computes the base's demands on all zones."""

    def __init__(self, base: PlanarBase, description: RobotDescription, tick_seconds: float) -> None:
        index = {axis.name: number for number, axis in enumerate(description.axes)}
        joints = {joint.name: number for number, joint in enumerate(description.joints)}
        self._zones = [Zone(fence) for fence in description.geofences]
        self._pose = (joints[base.x], joints[base.y], joints[base.yaw])
        headings = ((base.forward, 0.0), (base.left, math.pi / 2))
        self._moves = [
            (index[name], heading, description.axes[index[name]].brake) for name, heading in headings if name
        ]
        self._turn = (index[base.turn], description.axes[index[base.turn]].brake) if base.turn else None
        self._keep = base.radius + base.margin
        self._reaction = tick_seconds + base.latency
        self._clear: tuple[float, float, float] | None = None  # x, y (m) and the room to all zones there
        self.axes = tuple(number for number, _, _ in self._moves) + (() if self._turn is None else (self._turn[0],))

    def demands(self, offsets: Sequence[float], joints: Sequence[float]) -> list[Demand]:
        """Return the demands on the edges within reach; empty if the base does not move or is far from every edge."""
        parts = [
            (
                number,
                heading + (math.pi if offsets[number] < 0 else 0.0),
                *travel(offsets[number], self._reaction, brake),
            )
            for number, heading, brake in self._moves
            if offsets[number]
        ]
        if not parts:
            return []
        x, y, yaw = (joints[number] if number < len(joints) else math.nan for number in self._pose)
        if not (math.isfinite(x) and math.isfinite(y)):
            moving = tuple(part[0] for part in parts)
            return [doubt(zone.name, moving) for zone in self._zones]
        reach = sum(linear + square for _, _, linear, square in parts)
        if self._clear is not None and self._clear[2] - math.hypot(x - self._clear[0], y - self._clear[1]) >= reach:
            return []
        swing = math.pi if not math.isfinite(yaw) else self._swing(offsets)
        return self._judge(x, y, yaw if math.isfinite(yaw) else 0.0, swing, reach, parts)

    def _swing(self, offsets: Sequence[float]) -> float:
        """Return the angle that the turn covers until it has ended, at most half a circle."""
        if self._turn is None or not offsets[self._turn[0]]:
            return 0.0
        return min(math.pi, sum(travel(offsets[self._turn[0]], self._reaction, self._turn[1])))

    def _judge(
        self, x: float, y: float, yaw: float, swing: float, reach: float, parts: list[tuple[int, float, float, float]]
    ) -> list[Demand]:
        found: list[Demand] = []
        least = math.inf
        for zone in self._zones:
            is_right, places = zone.look(x, y)
            if is_right:
                least = min(least, min(place.distance for place in places) - self._keep)
                near = [place for place in places if place.distance - self._keep < reach]
            else:
                least = -math.inf
                place = min(places)
                near = [Nearest(self._keep, -place.nx, -place.ny)]  # no room at all for going farther astray
            for place in near:
                found.append(self._demand(zone.name, place, yaw, swing, parts))
        self._clear = (x, y, least)
        return found

    def _demand(
        self, name: str, place: Nearest, yaw: float, swing: float, parts: list[tuple[int, float, float, float]]
    ) -> Demand:
        bearing = math.atan2(place.ny, place.nx)
        linear = square = 0.0
        towards: list[int] = []
        for number, heading, reacting, braking in parts:
            away = abs(math.remainder(yaw + heading - bearing, math.tau))
            share = math.cos(max(0.0, away - swing))
            if share > 1e-12:  # rounding must not stop a motion along the edge
                linear, square = linear + share * reacting, square + share * braking
                towards.append(number)
        return Demand(name, tuple(towards), linear, square, place.distance - self._keep)
