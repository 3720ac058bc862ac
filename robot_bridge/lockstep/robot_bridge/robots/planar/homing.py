"""The planar robot's action `home`: it drives to the place where it began."""

import math
from collections.abc import Callable
from typing import Final

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionRun, ActionStep

__all__ = ["Homing"]

NEAR: Final = 0.01  # m
STRAIGHT: Final = 0.02  # rad
GAIN: Final = 2.0  # 1/s, of the speed for the distance that is left
PATIENCE: Final = 2.0  # s without getting nearer
NEARER: Final = 0.005  # m or rad that count as nearer

Pose = tuple[float, float, float]  # x and y in m, yaw in rad


class Homing(ActionRun):
    """Drives the axes straight to a pose. Walls and geofences may be in the way; then it gives up."""

    waits = True

    def __init__(self, pose: Callable[[], Pose], home: Pose, *, speed: float, turn: float, tick: float) -> None:
        """`speed`, `turn`: the fastest that it drives, m/s and rad/s. `tick`: s between two steps."""
        self._pose = pose
        self._home = home
        self._speed = speed
        self._turn = turn
        self._tick = tick
        self._whole = max(self._left(), NEARER)  # m and rad together, at the beginning
        self._least = math.inf
        self._waited = 0.0  # s

    def step(self) -> ActionStep:
        x, y, yaw = self._pose()
        left = self._left()
        dx, dy, dyaw = self._home[0] - x, self._home[1] - y, math.remainder(self._home[2] - yaw, math.tau)
        if math.hypot(dx, dy) < NEAR and abs(dyaw) < STRAIGHT:
            return ActionStep(progress=1.0, text="at home", done=True)
        self._notice(left)
        speed = min(GAIN * math.hypot(dx, dy), self._speed)
        heading = math.atan2(dy, dx) - yaw
        turn = min(max(GAIN * dyaw, -self._turn), self._turn)
        values = (speed * math.cos(heading), speed * math.sin(heading), turn)
        return ActionStep(progress=max(0.0, 1 - left / self._whole), text=f"{left:.1f} m to go", values=values)

    def cancel(self) -> None:
        """The bridge brings the axes to rest."""

    def _left(self) -> float:
        x, y, yaw = self._pose()
        turn = abs(math.remainder(self._home[2] - yaw, math.tau))
        return math.hypot(self._home[0] - x, self._home[1] - y) + 0.1 * turn

    def _notice(self, left: float) -> None:
        if left < self._least - NEARER:
            self._least, self._waited = left, 0.0
            return
        self._waited += self._tick
        if self._waited > PATIENCE:
            raise ActionFailed("something is in the way")
