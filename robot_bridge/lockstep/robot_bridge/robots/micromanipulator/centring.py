"""The micromanipulator's action `centre`: brings the tip of the needle to what was clicked on in a picture."""

import math
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible, ActionRun, ActionStep
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO

__all__ = ["Centring", "ShownPictures"]

NEAR: Final = 0.4 * MICRO  # m
SPEED: Final = 40 * MICRO  # m/s
PATIENCE: Final = 10.0  # s for the whole
OLDEST: Final = 2.0  # s that the picture may be old which was clicked on
KEPT: Final = 256  # events whose time is known: more than come in that time


class ShownPictures:
    """Remembers when the pictures of each event were taken. No clock: the caller hands in `now`."""

    def __init__(self) -> None:
        self._times: OrderedDict[int, float] = OrderedDict()  # by event: s, of its newest picture

    def shown(self, event: int, now: float) -> None:
        """Note a picture that is taken now."""
        self._times[event] = now
        self._times.move_to_end(event)
        if len(self._times) > KEPT:
            self._times.popitem(last=False)

    def check(self, event: float, now: float) -> None:
        """Check that a picture with this event may be pointed into.

        Raises:
            ActionNotPossible: it is too old, or there was none.
        """
        taken = self._times.get(int(event)) if event == int(event) else None
        if taken is None or now - taken > OLDEST:
            raise ActionNotPossible("the picture that was clicked on is too old")


class Centring(ActionRun):
    """Drives the probe along x and y in a straight line. The bridge's limits bound it as they bound a stick."""

    def __init__(
        self,
        tip: Callable[[], tuple[float, float, float]],
        goal: tuple[float, float],
        *,
        axes: int,
        tick: float,
    ) -> None:
        """`tip`: its place, m. `goal`: x and y, m. `axes`: of the robot; the first two move along x and y."""
        self._tip = tip
        self._goal = goal
        self._axes = axes
        self._tick = tick
        self._seconds = 0.0
        self._whole = max(self._left(), NEAR)

    def step(self) -> ActionStep:
        self._seconds += self._tick
        if self._seconds > PATIENCE:
            raise ActionFailed("the tip does not get to that place")
        left = self._left()
        if left < NEAR:
            return ActionStep(1.0, "there", done=True)
        x, y, _ = self._tip()
        speed = min(left / (5 * self._tick), SPEED) / left
        values = [0.0] * self._axes
        values[0], values[1] = (self._goal[0] - x) * speed, (self._goal[1] - y) * speed
        return ActionStep(max(0.0, 1 - left / self._whole), f"{left / MICRO:.0f} µm to go", values)

    def cancel(self) -> None:
        """The bridge brings the axes to rest."""

    def _left(self) -> float:
        x, y, _ = self._tip()
        return math.hypot(self._goal[0] - x, self._goal[1] - y)
