"""The micromanipulator's action `autofocus`: finds the height at which the tip of the needle is sharpest."""

from collections.abc import Callable
from typing import Final

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionRun, ActionStep
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO

__all__ = ["Autofocus"]

DEPTH: Final = 6 * MICRO  # m of distance from the plane that is sharp at which half of the sharpness is lost
NEAR: Final = 0.4 * MICRO
SPEED: Final = 30 * MICRO  # m/s
PATIENCE: Final = 10.0  # s for the whole


class Autofocus(ActionRun):
    """Sweeps the focus through its range, and goes back to the place where the picture was sharpest.

    It drives the axis of the focus, so the range of the focus bounds it as it bounds a stick.
    """

    waits = True

    def __init__(
        self,
        focus: Callable[[], float],
        blur: Callable[[], float],
        window: tuple[float, float],
        *,
        axes: int,
        axis: int,
        tick: float,
    ) -> None:
        """`focus`: its height, m. `blur`: distance of the tip from the plane that is sharp, m. `tick`: s of a step."""
        self._focus = focus
        self._blur = blur
        low, high = window
        self._goals = [low + MICRO, high - MICRO]  # of the sweep, short of the limits
        self._whole = high - low
        self._axes = axes
        self._axis = axis
        self._tick = tick
        self._seconds = 0.0
        self._best = (0.0, focus())  # sharpness from 0 to 1, and the height at which it was seen
        self._swept = 0  # goals that were reached

    def step(self) -> ActionStep:
        self._seconds += self._tick
        if self._seconds > PATIENCE:
            raise ActionFailed("the focus does not get to its place")
        place = self._focus()
        sharpness = 1 / (1 + (self._blur() / DEPTH) ** 2)
        if self._swept > 0:
            self._best = max(self._best, (sharpness, place))
        goal = self._goals[self._swept] if self._swept < len(self._goals) else self._best[1]
        if abs(goal - place) < NEAR:
            if self._swept == len(self._goals):
                return ActionStep(1.0, f"sharp at {place / MICRO:.1f} µm", done=True)
            self._swept += 1
        values = [0.0] * self._axes
        values[self._axis] = min(max((goal - place) / (5 * self._tick), -SPEED), SPEED)
        share = (self._swept + max(0.0, 1 - abs(goal - place) / self._whole)) / (len(self._goals) + 1)
        return ActionStep(min(share, 1.0), "looking for the tip", values)

    def cancel(self) -> None:
        """The bridge brings the axis to rest."""
