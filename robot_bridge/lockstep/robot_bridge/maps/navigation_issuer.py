"""Decides when the map and the navigation of a robot are sent. No I/O, no clock: the caller hands in `now`."""

import math
from collections.abc import Sequence

import msgspec

from lockstep.protocol.maps import MAX_COORDINATE, MAX_PATH_POINTS, Navigation, OccupancyMap
from lockstep.robot_bridge.robots.navigation import GridMap, NavigationNow, PlanarPose

__all__ = ["NavigationIssuer", "shortened"]

INTERVAL = 0.5  # s at least between two messages about the navigation, unless goal or map have changed
LEAST_INTERVAL = 0.1  # s, also then
MILLIMETRES = 3  # digits of a path behind the point
REPEAT = 1.0  # s, after which it is sent again though nothing has changed: its ages go on
MAP_INTERVAL = 1.0  # s at least between two maps
MAP_RATE = 4000.0  # bytes a second that maps may take of the network, on average


class NavigationIssuer:
    """Call `map_due` and `packed` for maps, `look` for the navigation; each says whether something is to be sent."""

    def __init__(self) -> None:
        self._grid: GridMap | None = None  # of which the newest message was made
        self._map: OccupancyMap | None = None
        self._next_map = -math.inf  # s
        self._sent: Navigation | None = None
        self._sent_at = -math.inf

    def map_due(self, grid: GridMap | None, now: float) -> bool:
        """Return whether this map has to be packed and sent now. While maps come too fast, the newest one waits."""
        return grid is not None and grid is not self._grid and now >= self._next_map

    def packed(self, grid: GridMap, message: OccupancyMap, now: float) -> OccupancyMap | None:
        """Note the message of a map. Return it if it says anything new."""
        is_news = self._map is None or message.id != self._map.id
        self._grid, self._map = grid, message
        if not is_news:
            self._next_map = now + MAP_INTERVAL
            return None
        self._next_map = now + max(MAP_INTERVAL, len(message.cells) / MAP_RATE)
        return message

    def look(self, state: NavigationNow | None, now: float, event: int) -> Navigation | None:
        """Return the message if it is due."""
        since = now - self._sent_at
        if state is None or since < LEAST_INTERVAL:
            return None
        message, sent = self._message(state, now, event), self._sent
        if sent is not None and since < INTERVAL and (message.goal, message.map) == (sent.goal, sent.map):
            return None
        if sent is not None and since < REPEAT and _without_ages(message) == _without_ages(sent):
            return None
        self._sent, self._sent_at = message, now
        return message

    def _message(self, state: NavigationNow, now: float, event: int) -> Navigation:
        numbers = [number for point in shortened(state.path) for number in point]
        path = [round(number, MILLIMETRES) for number in numbers] if all(map(_is_coordinate, numbers)) else []
        frame, goal = _sendable(state.frame), _sendable(state.goal)
        return Navigation(
            event=event,
            map="" if self._map is None else self._map.id,
            map_age=0.0 if self._grid is None else max(0.0, now - self._grid.time),
            located=frame is not None,
            frame=frame or (0.0, 0.0, 0.0),
            goal=[] if goal is None else list(goal),
            path=path,
            path_age=max(0.0, now - state.path_time) if path else 0.0,
        )


def shortened(path: Sequence[tuple[float, float]]) -> Sequence[tuple[float, float]]:
    """Return at most `MAX_PATH_POINTS` of the points, evenly spread, with the first and the last."""
    if len(path) <= MAX_PATH_POINTS:
        return path
    step = (len(path) - 1) / (MAX_PATH_POINTS - 1)
    return [path[round(index * step)] for index in range(MAX_PATH_POINTS)]


def _sendable(pose: PlanarPose | None) -> PlanarPose | None:
    """Return a pose that the message takes; None for another one: the console would keep an older place instead."""
    return pose if pose is not None and all(map(_is_coordinate, pose)) else None


def _is_coordinate(number: float) -> bool:
    return abs(number) <= MAX_COORDINATE


def _without_ages(message: Navigation) -> Navigation:
    return msgspec.structs.replace(message, event=1, map_age=0.0, path_age=0.0)
