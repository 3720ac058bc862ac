"""The micromanipulator's actions that go to a place: `centre` and `tip_to_middle`."""

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
KEPT: Final = 256  # events that are known: more than come in that time

Place = tuple[float, float]  # x and y, m


class ShownPictures:
    """Remembers when and where the pictures of each event were taken. No clock: the caller hands in `now`."""

    def __init__(self) -> None:
        self._taken: OrderedDict[int, tuple[float, Place]] = OrderedDict()  # by event: of its newest picture, s and m

    def shown(self, event: int, middle: Place, now: float) -> None:
        """Note a picture that is taken now. `middle`: what its middle shows."""
        self._taken[event] = now, middle
        self._taken.move_to_end(event)
        if len(self._taken) > KEPT:
            self._taken.popitem(last=False)

    def middle(self, event: float, now: float) -> Place:
        """Return what the middle of this event's newest picture shows.

        Raises:
            ActionNotPossible: the picture is too old, or there was none.
        """
        taken = self._taken.get(int(event)) if event == int(event) else None
        if taken is None or now - taken[0] > OLDEST:
            raise ActionNotPossible("the picture that was clicked on is too old")
        return taken[1]


class Centring(ActionRun):
    """Drives two axes in a straight line to a place. The bridge's limits bound it as they bound a stick."""

    waits = True

    def __init__(
        self,
        place: Callable[[], tuple[float, ...]],
        goal: Place,
        *,
        axes: int,
        first: int,
        tick: float,
        result: str = "there",
    ) -> None:
        """`place`: where it is now: x, y, m. `axes`: of the robot; `first` and the next move along x and y.

        `result`: what it says at the end. `tick`: s of a step.
        """
        self._place = place
        self._goal = goal
        self._axes = axes
        self._first = first
        self._tick = tick
        self._result = result
        self._seconds = 0.0
        self._whole = max(self._left(), NEAR)

    def step(self) -> ActionStep:
        self._seconds += self._tick
        if self._seconds > PATIENCE:
            raise ActionFailed("the drives do not get to that place")
        left = self._left()
        if left < NEAR:
            return ActionStep(1.0, self._result, done=True)
        speed = min(left / (5 * self._tick), SPEED) / left
        values = [0.0] * self._axes
        for axis, goal, at in zip((self._first, self._first + 1), self._goal, self._place(), strict=False):
            values[axis] = (goal - at) * speed
        return ActionStep(max(0.0, 1 - left / self._whole), f"{left / MICRO:.0f} µm to go", values)

    def cancel(self) -> None:
        """The bridge brings the axes to rest."""

    def _left(self) -> float:
        x, y, *_ = self._place()
        return math.hypot(self._goal[0] - x, self._goal[1] - y)
