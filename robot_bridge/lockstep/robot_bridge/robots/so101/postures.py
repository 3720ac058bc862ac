"""The arm's actions: it goes to a posture that it knows, by goals that pass through the bridge as an operator's do."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionRun, ActionStep

__all__ = ["FOLDED", "GoTo"]

FOLDED: Final[tuple[float, ...]] = (0.0, -1.68, 1.48, 0.9, 0.0, 0.0)  # rad, of each joint: low and near the foot
NEAR: Final = 0.03  # rad, of every joint
NEARER: Final = 0.01  # rad, of all joints together, that count as nearer
PATIENCE: Final = 2.0  # s without getting nearer


class GoTo(ActionRun):
    """Moves some joints to their goals, all of them at once."""

    def __init__(
        self,
        goals: Mapping[int, float],
        axes: int,
        joints: Callable[[], Sequence[float]],
        tick: float,
        text: str,
        rest: Sequence[float | None] = (),
    ) -> None:
        """`goals`: rad, by number of axis. `axes`: their count. `joints`: measured. `tick`: s between two steps.

        `rest`: what the other axes get, if not all of them are goal axes.
        """
        self._goals = dict(goals)
        self._rest = tuple(rest) or (None,) * axes
        self._joints = joints
        self._tick = tick
        self._text = text
        self._whole = max(sum(self._left()), NEARER)
        self._least = self._whole + 1.0
        self._waited = 0.0  # s

    def step(self) -> ActionStep:
        left = self._left()
        total = sum(left)
        if max(left) < NEAR:
            return ActionStep(progress=1.0, text=self._text, done=True)
        if total < self._least - NEARER:
            self._least, self._waited = total, 0.0
        else:
            self._waited += self._tick
        if self._waited > PATIENCE:
            raise ActionFailed("something is in the way of the arm")
        return ActionStep(progress=max(0.0, 1 - total / self._whole), text=self._text, values=self._values())

    def cancel(self) -> None:
        """The bridge brings the goals to rest."""

    def _left(self) -> list[float]:
        joints = self._joints()
        return [abs(goal - joints[number]) for number, goal in self._goals.items()]

    def _values(self) -> list[float | None]:
        return [self._goals.get(number, rest) for number, rest in enumerate(self._rest)]
