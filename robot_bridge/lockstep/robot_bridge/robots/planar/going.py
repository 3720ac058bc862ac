"""The planar robot's actions `go_to` and `dock`: it plans a way around the pillars, and drives along it."""

import math
from collections.abc import Callable
from typing import Final

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionRun, ActionStep
from lockstep.robot_bridge.robots.navigation import PlanarPose
from lockstep.robot_bridge.robots.route_search import NoRoute, RouteSearch

__all__ = ["Going"]

NEAR: Final = 0.02  # m
STRAIGHT: Final = 0.03  # rad
PASSED: Final = 0.1  # m from a corner that is not the last, where the robot turns to the next
GAIN: Final = 2.0  # 1/s
CELL: Final = 0.1  # m, of the search
MOST_CELLS: Final = 10_000
CELLS_A_TICK: Final = 60  # keeps a tick short: about a millisecond
PATIENCE: Final = 2.0  # s without getting nearer
NEARER: Final = 0.005  # m


class Going(ActionRun):
    """Drives the axes along the way to a pose."""

    waits = True

    def __init__(
        self,
        pose: Callable[[], PlanarPose],
        goal: PlanarPose,
        has_room: Callable[[float, float], bool],
        *,
        speed: float,
        turn: float,
        tick: float,
        ended: Callable[[], None],
        result: str = "arrived",
    ) -> None:
        """`speed`, `turn`: the fastest that it drives, m/s and rad/s. `tick`: s between two steps.

        `ended`: called when it is done, has failed or was cancelled. `result`: what it says when it is there.
        """
        self.goal = goal
        self._pose = pose
        self._speed = speed
        self._turn = turn
        self._tick = tick
        self._ended = ended
        self._result = result
        self._search: RouteSearch | None = RouteSearch(pose()[:2], goal[:2], has_room, cell=CELL, most=MOST_CELLS)
        self._corners: list[tuple[float, float]] = []  # that are still to be passed, the goal last
        self._whole = 0.0  # m, of the whole way
        self._least = math.inf
        self._waited = 0.0  # s

    def path(self) -> list[tuple[float, float]]:
        """Return the way that is left, from the robot on; empty while it is planned."""
        return [self._pose()[:2], *self._corners] if self._corners else []

    def step(self) -> ActionStep:
        try:
            if self._search is not None:
                return self._plan(self._search)
            return self._drive()
        except ActionFailed:
            self._ended()
            raise

    def cancel(self) -> None:
        """The bridge brings the axes to rest."""
        self._ended()

    def _plan(self, search: RouteSearch) -> ActionStep:
        try:
            route = search.advance(CELLS_A_TICK)
        except NoRoute as error:
            raise ActionFailed("there is no way to that place") from error
        if route is not None:
            self._search, self._corners = None, route[1:]
            self._whole = max(self._left(), NEARER)
        return ActionStep(text="planning")

    def _drive(self) -> ActionStep:
        x, y, yaw = self._pose()
        while len(self._corners) > 1 and math.dist((x, y), self._corners[0]) < PASSED:
            self._corners.pop(0)
        left = self._left()
        dyaw = math.remainder(self.goal[2] - yaw, math.tau)
        if left < NEAR and abs(dyaw) < STRAIGHT:
            self._ended()
            return ActionStep(progress=1.0, text=self._result, done=True)
        self._notice(left + 0.1 * abs(dyaw))
        (next_x, next_y), is_last = self._corners[0], len(self._corners) == 1
        away = math.hypot(next_x - x, next_y - y)
        speed = min(GAIN * (away if is_last else left), self._speed)
        heading = math.atan2(next_y - y, next_x - x) - yaw
        turn = min(max(GAIN * dyaw, -self._turn), self._turn)
        return ActionStep(
            progress=max(0.0, 1 - left / self._whole),
            text=f"{left:.1f} m to go",
            values=(speed * math.cos(heading), speed * math.sin(heading), turn),
        )

    def _left(self) -> float:
        """Return the length of the way that is left, m."""
        points = [self._pose()[:2], *self._corners]
        return sum(math.dist(start, end) for start, end in zip(points, points[1:], strict=False))

    def _notice(self, left: float) -> None:
        if left < self._least - NEARER:
            self._least, self._waited = left, 0.0
            return
        self._waited += self._tick
        if self._waited > PATIENCE:
            raise ActionFailed("something is in the way")
