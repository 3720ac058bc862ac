"""A person with a headset's controller, who leads the tool by the hand. No I/O, no clock.

The page binds hand and tool where the grip is squeezed; from then on the tool's goal moves as the hand does. So the
hand goes the way that the goal still has to go, turned from the robot's frame into the headset's.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from lockstep.bench.pick_place.motions import POSITION, ROTATION
from lockstep.bench.pick_place.pad_hand import deflection
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector, quaternion, rotation_vector

__all__ = ["ControllerHand", "ControllerMove"]

Array = npt.NDArray[np.float64]

GRIP: Final = (0.2, 1.3, -0.4)  # m, where the right hand is first
STEP, TURN = 0.015, 0.06  # m and rad from one look to the next: a calm hand
SAME_PLACE, SAME_TURN = 0.0005, 0.003  # m and rad, within which it holds still
CLOSE: Final = 0.01  # rad, of the gripper
FULL: Final = 2.5  # rad/s, of the gripper with the trigger pulled
# WebXR has x to the right, y up and -z ahead; the robot x ahead, y to the left and z up.
TO_SPACE: Final = np.array(((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0)))


@dataclass
class ControllerMove:
    """Where the right controller is now, in the headset's space, and how far both triggers are pulled.

    Attributes:
        position: x y z, m
        turned: a quaternion x, y, z, w
        triggers: 0 to 1, left and right
    """

    position: list[float]
    turned: list[float]
    triggers: tuple[float, float]


class ControllerHand:
    """The right hand; the left one only pulls its trigger, which closes the gripper."""

    def __init__(self) -> None:
        self._position = np.array(GRIP)
        self._rotation = np.eye(3)

    def move(
        self,
        wanted: Mapping[str, float],
        commanded: Mapping[str, float | None],
        applied: Mapping[str, float | None],
        gain: float,
    ) -> ControllerMove:
        """Go on from the goals that the page commands now to those that are wanted.

        Args:
            wanted: goals by axis
            commanded: by the page, now; None: the tool is not led
            applied: the robot's, as seen
            gain: 1/s, of the gripper's speed by its way
        """
        pose = [commanded.get(name) for name in (*POSITION, *ROTATION)]
        if POSITION[0] in wanted and None not in pose:
            place = np.array([value or 0.0 for value in pose])
            goal = np.array([wanted[name] for name in (*POSITION, *ROTATION)])
            self._lead(place, goal)
        x, y, z = self._position.tolist()
        w, *turned = quaternion(self._rotation)
        return ControllerMove([x, y, z], [*turned, w], self._triggers(wanted, applied, gain))

    def _lead(self, place: Array, goal: Array) -> None:
        way = goal[:3] - place[:3]
        turn = rotation_vector(_matrix(goal[3:]) @ _matrix(place[3:]).T)
        self._position = self._position + TO_SPACE @ _bounded(way, SAME_PLACE, STEP)
        self._rotation = _matrix(TO_SPACE @ _bounded(turn, SAME_TURN, TURN)) @ self._rotation

    def _triggers(
        self, wanted: Mapping[str, float], applied: Mapping[str, float | None], gain: float
    ) -> tuple[float, float]:
        grip = applied.get("gripper")
        if "gripper" not in wanted or grip is None:
            return 0.0, 0.0
        way = wanted["gripper"] - grip
        pulled = deflection(min(gain * abs(way) / FULL, 1.0)) if abs(way) > CLOSE else 0.0
        return (0.0, pulled) if way > 0 else (pulled, 0.0)


def _matrix(vector: Array) -> Array:
    return from_rotation_vector(vector.tolist())


def _bounded(way: Array, same: float, most: float) -> Array:
    """Return the way, of at most a length; nothing of a very short one."""
    length = float(np.linalg.norm(way))
    if length < same:
        return np.zeros(3)
    return way * min(1.0, most / length)
