"""Senses the force of all outside contacts of the arm, as one wrench in the frame of its hand.

The fingers press against each other through what they hold, so that a grasp cancels: what is left is the weight of what
is held, and the push of everything that the arm touches.
"""

import math
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.so101.model import LINKS, PREFIX

__all__ = ["HAND", "ContactForce"]

Array = npt.NDArray[np.float64]

HAND: Final = "arm.gripper"
TIME_CONSTANT: Final = 0.03  # s of the low-pass


class ContactForce:
    """Reads MuJoCo's contacts.

    Attributes:
        wrench: fx fy fz (N), tx ty tz (N m) on the arm, in the hand's frame, low-passed
    """

    def __init__(self, model: Any) -> None:
        self._model = model
        self._hand = model.body(HAND).id
        links = [model.body(PREFIX + name).id for name in LINKS[1:]]  # the foot stands on the table
        self._is_arm = np.isin(model.geom_bodyid, links)  # per geom
        self._is_foot = model.geom_bodyid == model.body(PREFIX + LINKS[0]).id
        self._local = np.zeros(6)
        self.wrench: Array = np.zeros(6)

    def update(self, data: Any, seconds: float) -> None:
        """Read the contacts of the last step, `seconds` after the reading before."""
        self.wrench += (self.read(data) - self.wrench) * -math.expm1(-seconds / TIME_CONSTANT)

    def read(self, data: Any) -> Array:
        """Return the wrench of the last step, not filtered."""
        wrench = np.zeros(6)
        if not data.ncon:
            return wrench
        geoms = data.contact.geom
        arm = self._is_arm[geoms]
        felt = np.flatnonzero((arm[:, 0] != arm[:, 1]) & ~self._is_foot[geoms].any(axis=1))
        if not felt.size:
            return wrench
        turn, place = data.xmat[self._hand].reshape(3, 3), data.xpos[self._hand]
        for index in felt.tolist():
            mujoco.mj_contactForce(self._model, data, index, self._local)
            contact = data.contact[index]
            world = contact.frame.reshape(3, 3).T @ self._local[:3] * (1.0 if arm[index, 1] else -1.0)
            wrench[:3] += world @ turn
            wrench[3:] += np.cross(contact.pos - place, world) @ turn
        return wrench
