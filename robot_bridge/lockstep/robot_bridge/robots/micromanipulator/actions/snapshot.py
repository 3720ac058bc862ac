"""The micromanipulator's action `snapshot`: takes the microscope's next picture and says which one it is."""

from collections.abc import Callable
from typing import Final, NamedTuple

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionRun, ActionStep
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO

__all__ = ["Snapshot", "TakenPicture"]

PATIENCE: Final = 2.0  # s: of pictures that come at the camera's rate


class TakenPicture(NamedTuple):
    """A picture of the microscope: its number since the start, its event and its focus."""

    number: int
    event: int  # that its stamp names
    focus: float  # m, height of the plane that is sharp


class Snapshot(ActionRun):
    """Waits for the first picture after the request. It keeps none: its result says where a recording has it."""

    def __init__(self, newest: Callable[[], TakenPicture | None], *, tick: float, taken: Callable[[], None]) -> None:
        """`newest`: the last picture. `tick`: s of a step. `taken`: called when it has the picture."""
        self._newest = newest
        self._before = newest()
        self._tick = tick
        self._taken = taken
        self._seconds = 0.0

    def step(self) -> ActionStep:
        picture = self._newest()
        if picture is not None and picture != self._before:
            self._taken()
            text = f"picture of event {picture.event}, focus {picture.focus / MICRO:.1f} µm; only recordings keep it"
            return ActionStep(1.0, text, done=True)
        self._seconds += self._tick
        if self._seconds > PATIENCE:
            raise ActionFailed("no picture comes from the microscope")
        return ActionStep(text="waits for the picture")

    def cancel(self) -> None:
        """Nothing moves."""
