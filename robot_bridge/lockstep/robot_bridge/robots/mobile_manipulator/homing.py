"""The mobile manipulator's action `home`: the arm goes back to the posture in which it began."""

from typing import Final, Protocol

from lockstep.robot_bridge.robots.actions import ActionFailed, ActionRun, ActionStep

__all__ = ["HomingArm", "Homing"]

NEAR: Final = 0.02  # rad, of every joint
NEARER: Final = 0.01  # rad, of all joints together, that count as nearer
PATIENCE: Final = 2.0  # s without getting nearer


class HomingArm(Protocol):
    """An arm that finds home by itself."""

    def from_home(self) -> list[float]:
        """Return the distance of each joint from home, rad."""

    def go_home(self) -> None:
        """Move there until `stay`."""

    def stay(self) -> None:
        """Go no farther."""


class Homing(ActionRun):
    """Moves the arm joint by joint, in a way of its own: position limits of the description do not slow it.

    The servos' lead bounds the push of an arm that is blocked, as it does while driving.
    """

    waits = True

    def __init__(self, arm: HomingArm, tick: float) -> None:
        """`tick`: s between two steps."""
        self._arm = arm
        self._tick = tick
        self._whole = max(sum(arm.from_home()), NEARER)
        self._least = self._whole + 1.0
        self._waited = 0.0  # s
        arm.go_home()

    def step(self) -> ActionStep:
        left = self._arm.from_home()
        total = sum(left)
        if max(left) < NEAR:
            self._arm.stay()
            return ActionStep(progress=1.0, text="the arm is at home", done=True)
        if total < self._least - NEARER:
            self._least, self._waited = total, 0.0
        else:
            self._waited += self._tick
        if self._waited > PATIENCE:
            self._arm.stay()
            raise ActionFailed("something is in the way of the arm")
        return ActionStep(progress=max(0.0, 1 - total / self._whole), text="the arm goes home")

    def cancel(self) -> None:
        self._arm.stay()
