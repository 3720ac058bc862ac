"""Gathers the audible events of the physics tick by tick until a segment of sound is made of them."""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from lockstep.robot_bridge.robots.mobile_manipulator.contact_sense import ContactReading
from lockstep.robot_bridge.robots.mobile_manipulator.simulation import JOINTS

__all__ = ["Heard", "Hearing"]

DRUM_RADIUS: Final = 0.31  # m, turns the base's turning into the speed of its wheels
KNOCK: Final = 6.0  # N, smaller jumps of contact force make no sound
ARM_LENGTH: Final = 0.3  # m, turns joint speeds into a speed of the skin, roughly
OBJECT_FRICTION: Final = 3.0  # N, the same for all movable objects that slide


class Heard(NamedTuple):
    """The sounds of one segment: means of the speeds and of the rubbing, the sum of the knocks."""

    wheels: float = 0.0  # m/s
    arm: float = 0.0  # rad/s, the three large joints
    wrist: float = 0.0  # rad/s, the three small joints
    rubbing: float = 0.0  # W, roughly
    knocks: float = 0.0  # N, sum of sudden rises of contact force


class Hearing:
    """Hears the physics. Call `listen` after each tick, `take` once per segment."""

    def __init__(self, model: Any) -> None:
        free = [index for index in range(model.njnt) if index >= JOINTS]
        self._objects = model.jnt_dofadr[free][:, None] + np.arange(3)  # the linear velocity of each movable object
        self._sums = [0.0] * 4  # wheels, arm, wrist, rubbing
        self._knocks = 0.0
        self._ticks = 0
        self._pressure: float | None = None  # N, of all contacts at the last tick

    def listen(self, data: Any, contacts: ContactReading) -> None:
        speeds = data.qvel
        vx, vy, wz, *arm = map(abs, speeds[:JOINTS].tolist())
        wheels = math.hypot(vx, vy) + DRUM_RADIUS * wz
        large, small = sum(arm[:3]), sum(arm[3:])
        rubbing = contacts.rubbing * (wheels + ARM_LENGTH * (large + small))
        others = speeds[JOINTS:]
        if others.dot(others):  # mostly nothing but the robot moves, and this is the quickest way to see it
            rubbing += OBJECT_FRICTION * float(np.sqrt((speeds[self._objects] ** 2).sum(axis=1)).sum())
        for index, level in enumerate((wheels, large, small, rubbing)):
            self._sums[index] += level
        self._ticks += 1
        if self._pressure is not None:
            rise = contacts.normal - self._pressure
            self._knocks += max(0.0, rise - KNOCK - 0.2 * self._pressure)
        self._pressure = contacts.normal

    def take(self) -> Heard:
        """Return the sounds since the last call; zeros if there was no tick in between."""
        if not self._ticks:
            return Heard()
        wheels, arm, wrist, rubbing = (each / self._ticks for each in self._sums)
        heard = Heard(wheels, arm, wrist, rubbing, self._knocks)
        self._sums, self._knocks, self._ticks = [0.0] * 4, 0.0, 0
        return heard
