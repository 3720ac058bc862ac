"""The physics: the model, its state, and the places of the arm's parts in MuJoCo's arrays."""

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.so101.model import JOINT_NAMES, PREFIX, build_model

__all__ = ["HOME", "Simulation"]

Array = npt.NDArray[np.float64]

_logger = logging.getLogger(__name__)

# rad, of each joint: over the table, the gripper down and half open
HOME: Final[tuple[float, ...]] = (0.0, -0.55, 0.30, 1.55, 0.0, 0.3)
REST_SPEED: Final = 0.03  # rad/s
BLOCKS: Final = ("red_block", "green_block", "blue_block")
BOWL: Final = "bowl"
IN_BOWL: Final = (0.055, 0.07)  # m from the bowl's axis, and above its bottom


class Simulation:
    """Steps the physics.

    Attributes:
        restarts: number of times that a diverged state was put back to its beginning
    """

    def __init__(self, arm_file: Path) -> None:
        """Raises: ModelError: the file is not the arm that this robot needs."""
        mujoco.set_mju_user_warning(warn)  # else MuJoCo writes a file into the working directory
        self.model = build_model(arm_file)
        self.data = mujoco.MjData(self.model)
        self.restarts = 0
        joints = [self.model.joint(PREFIX + name).id for name in JOINT_NAMES]
        self._places = self.model.jnt_qposadr[joints]
        self._speeds = self.model.jnt_dofadr[joints]
        self._servos = [self.model.actuator(PREFIX + name).id for name in JOINT_NAMES]
        self._things = {name: self.model.body(name).id for name in (*BLOCKS, BOWL)}
        self._stiffness = self.model.actuator_gainprm[self._servos, 0].copy()  # N m/rad
        self._damping = self.model.dof_damping[self._speeds] - self.model.actuator_biasprm[self._servos, 2]
        self._force_range = self.model.actuator_forcerange[self._servos].copy()
        self.restart()

    def restart(self) -> None:
        """Put everything back to its beginning, at rest."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._places] = HOME
        self.data.ctrl[self._servos] = HOME
        mujoco.mj_forward(self.model, self.data)
        self.aim(HOME, np.zeros(len(HOME)))

    def put_things_back(self) -> None:
        """Put blocks and bowl back to where they began; the arm stays as it is."""
        for body in self._things.values():
            joint = self.model.body_jntadr[body]
            place, speed = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
            self.data.qpos[place : place + 7] = self.model.qpos0[place : place + 7]
            self.data.qvel[speed : speed + 6] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def put(self, body: str, position: Sequence[float], turn: float) -> None:
        """Put a block or the bowl there (m), turned about the vertical (rad), at rest."""
        joint = self.model.body_jntadr[self._things[body]]
        place, speed = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
        self.data.qpos[place : place + 7] = (*position, math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2))
        self.data.qvel[speed : speed + 6] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def aim(self, goals: Sequence[float] | Array, rates: Array) -> None:
        """Give the servos their goals (rad), which move by `rates` (rad/s).

        A servo has a spring and a damper: it aims ahead by what the arm's own weight and the damping take. A load that
        the arm carries is not known, and bends it.
        """
        ahead = (self.data.qfrc_bias[self._speeds] + self._damping * rates) / self._stiffness
        self.data.ctrl[self._servos] = goals + ahead

    def step(self, count: int) -> bool:
        """Let `count` timesteps pass. False if the state diverged and was put back to its beginning."""
        before = self.data.time
        mujoco.mj_step(self.model, self.data, count)
        if self.data.time > before and np.isfinite(self.data.qvel).all():
            return True
        self.restarts += 1  # MuJoCo resets the state, and with it the time, when it finds a value that is not finite
        self.restart()
        return False

    def joints(self) -> list[float]:
        """Return the measured joint positions, rad."""
        return self.data.qpos[self._places].tolist()  # type: ignore[no-any-return]

    def rates(self) -> Array:
        """Return the measured joint velocities, rad/s."""
        return self.data.qvel[self._speeds]  # type: ignore[no-any-return]

    def torque(self, joint: int) -> float:
        """Return the torque of a joint's servo, N m."""
        return float(self.data.actuator_force[self._servos[joint]])

    def place(self, body: str) -> Array:
        """Return where a block or the bowl is, m."""
        return self.data.xpos[self._things[body]].copy()  # type: ignore[no-any-return]

    def turn(self, body: str) -> float:
        """Return how a block or the bowl is turned about the vertical, rad."""
        matrix = self.data.xmat[self._things[body]].tolist()
        return math.atan2(matrix[3], matrix[0])

    def blocks_in_bowl(self) -> int:
        """Return how many blocks lie in the bowl."""
        bowl = self.data.xpos[self._things[BOWL]]
        turn = self.data.xmat[self._things[BOWL]].reshape(3, 3)
        count = 0
        for name in BLOCKS:
            x, y, z = ((self.data.xpos[self._things[name]] - bowl) @ turn).tolist()
            count += x * x + y * y < IN_BOWL[0] ** 2 and 0.0 < z < IN_BOWL[1]
        return count

    def snapshot(self) -> Array:
        """Return the part of the present state that a picture needs."""
        return self.data.qpos.copy()  # type: ignore[no-any-return]


def warn(text: str) -> None:
    _logger.warning("MuJoCo: %s", text)
