"""Senses the forces of all outside contacts on base and arm, as one wrench.

The wrench is the sum over every contact between a body of the robot (base, arm, tool) and anything else, expressed in
the frame of the arm's mount on the base (x forward, y left, z up, origin on top of the drum). So pushing an object with
the tool and bumping the base into a wall are both felt, against the direction that the stick drives to. The wrench does
not include contacts of the robot with itself, nor its own weight and inertia.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.mobile_manipulator.simulation import MOUNT

__all__ = ["ContactReading", "ContactSense"]

Array = npt.NDArray[np.float64]

TIME_CONSTANT: Final = 0.03  # s of the wrench's low-pass
FELT: Final = 1e-6  # N and N m, below which a contact counts as over
NOTHING: Final = np.zeros(6)
NOTHING.flags.writeable = False


class ContactReading(NamedTuple):
    wrench: Array  # fx fy fz (N), tx ty tz (N m) on the robot in the mount's frame, unfiltered
    normal: float  # N, sum of the normal forces of all contacts in the room, including the weight of sleeping bodies
    rubbing: float  # N, sum of the friction forces on the robot


class ContactSense:
    """Reads MuJoCo's contacts; `wrench` is low-passed."""

    def __init__(self, model: Any) -> None:
        base = model.body("base").id
        self._is_robot = model.body_rootid[model.geom_bodyid] == base  # per geom
        self._mount = model.body(MOUNT).id
        moving = model.body_treeid >= 0
        masses = np.bincount(model.body_treeid[moving], model.body_mass[moving], model.ntree)
        self._weights = masses * float(np.linalg.norm(model.opt.gravity))  # N, of each free body
        self._asleep = b""  # the bodies that slept at the last look
        self._resting = 0.0  # N, weight of those bodies
        self.wrench: Array = np.zeros(6)

    def clear(self) -> None:
        self.wrench = np.zeros(6)

    def update(self, data: Any, seconds: float) -> ContactReading:
        """Read the contacts of the last step, `seconds` after the reading before."""
        reading = self.read(data)
        if reading.wrench is not self.wrench:  # else nothing touches, and nothing did for a while
            self.wrench = self.wrench + (reading.wrench - self.wrench) * -math.expm1(-seconds / TIME_CONSTANT)
            if reading.wrench is NOTHING and np.abs(self.wrench).max() < FELT:
                self.wrench = NOTHING
        return reading

    def read(self, data: Any) -> ContactReading:
        # A sleeping body has no contacts: without its weight, waking it would be heard as a blow.
        resting = self._resting_weight(data.tree_asleep)
        if not data.ncon:  # the robot stands on nothing but its own drives
            return ContactReading(NOTHING, resting, 0.0)
        contact = data.contact
        rows = contact.efc_address  # of the normal force; -1 for a contact that is not active
        normal = float(data.efc_force[rows[rows >= 0]].sum()) + resting
        robot = self._is_robot[contact.geom]
        felt = np.flatnonzero((rows >= 0) & (robot[:, 0] != robot[:, 1]))  # equal: none or both are the robot's
        if not felt.size:
            return ContactReading(NOTHING, normal, 0.0)
        # With elliptic cones a contact's rows are its force along the contact frame: normal, then two tangents.
        local = data.efc_force[rows[felt][:, None] + np.arange(3)]
        sign = np.where(robot[felt, 1], 1.0, -1.0)  # the force acts on the second geom
        world = np.einsum("nij,ni->nj", contact.frame[felt].reshape(-1, 3, 3), local) * sign[:, None]
        lever = contact.pos[felt] - data.xpos[self._mount]
        rotation = data.xmat[self._mount].reshape(3, 3)
        force, torque = world.sum(axis=0) @ rotation, np.cross(lever, world).sum(axis=0) @ rotation
        rubbing = float(np.hypot(local[:, 1], local[:, 2]).sum())
        return ContactReading(np.concatenate((force, torque)), normal, rubbing)

    def _resting_weight(self, asleep: Array) -> float:
        """Return the weight of the sleeping bodies, N; it is asked for in every tick and seldom changes."""
        if (now := asleep.tobytes()) != self._asleep:
            self._asleep, self._resting = now, float(self._weights @ (asleep >= 0))
        return self._resting
