"""A* (Hart, Nilsson, Raphael 1968) on a square grid, in bounded steps. No I/O, no clock."""

import heapq
import math
from collections.abc import Callable

__all__ = ["NoRoute", "RouteSearch"]

Point = tuple[float, float]  # m
_Cell = tuple[int, int]

NEIGHBOURS = [(dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]
SIGHT = 4  # points looked at per cell where a line is checked


class NoRoute(Exception):
    """There is no way from here to there."""


class RouteSearch:
    """Call `advance` until it returns the route."""

    def __init__(
        self, start: Point, goal: Point, has_room: Callable[[float, float], bool], *, cell: float, most: int
    ) -> None:
        """`has_room`: whether the robot fits at a place. `cell`: side of a cell, m. `most`: cells to look at."""
        self._start = start
        self._goal = goal
        self._has_room = has_room
        self._cell = cell
        self._left = most
        self._target = self._cell_of(goal)
        begin = self._cell_of(start)
        self._costs = {begin: 0.0}
        self._before: dict[_Cell, _Cell] = {}
        self._open = [(self._guess(begin), begin)]
        self._done: set[_Cell] = set()

    def advance(self, cells: int) -> list[Point] | None:
        """Look at so many cells. Return the corners of the route from start to goal; None while it is not found.

        Raises:
            NoRoute: there is none, or it is too far.
        """
        for _ in range(cells):
            if not self._open or self._left <= 0:
                raise NoRoute
            _, cell = heapq.heappop(self._open)
            if cell == self._target:
                return self._straightened(self._cells_to(cell))
            if cell in self._done:
                continue
            self._done.add(cell)
            self._left -= 1
            for dx, dy, step in NEIGHBOURS:
                self._look(cell, (cell[0] + dx, cell[1] + dy), step)
        return None

    def _look(self, cell: _Cell, beside: _Cell, step: float) -> None:
        cost = self._costs[cell] + step
        if cost >= self._costs.get(beside, math.inf):
            return
        if beside != self._target and not self._has_room(beside[0] * self._cell, beside[1] * self._cell):
            return
        self._costs[beside] = cost
        self._before[beside] = cell
        heapq.heappush(self._open, (cost + self._guess(beside), beside))

    def _guess(self, cell: _Cell) -> float:
        return math.hypot(cell[0] - self._target[0], cell[1] - self._target[1])

    def _cell_of(self, point: Point) -> _Cell:
        return round(point[0] / self._cell), round(point[1] / self._cell)

    def _cells_to(self, cell: _Cell) -> list[Point]:
        found = [self._goal]
        while cell in self._before:
            cell = self._before[cell]
            found.append((cell[0] * self._cell, cell[1] * self._cell))
        found[-1] = self._start
        return found[::-1] if len(found) > 1 else [self._start, self._goal]

    def _straightened(self, points: list[Point]) -> list[Point]:
        """Leave out every point that the one before it can pass by in a straight line."""
        kept = [points[0]]
        for index in range(1, len(points) - 1):
            if not self._sees(kept[-1], points[index + 1]):
                kept.append(points[index])
        return [*kept, points[-1]]

    def _sees(self, start: Point, end: Point) -> bool:
        length = math.dist(start, end)
        count = max(1, math.ceil(length / self._cell * SIGHT))
        for index in range(1, count):
            share = index / count
            if not self._has_room(start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])):
                return False
        return True
