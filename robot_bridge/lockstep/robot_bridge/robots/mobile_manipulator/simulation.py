"""The physics: the model, its state, and the places of the robot's parts in MuJoCo's arrays."""

import logging
import math
from importlib.resources import files
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

__all__ = ["ARM", "BASE", "MOUNT", "TOOL_TIP", "Simulation", "load_model"]

Array = npt.NDArray[np.float64]

_logger = logging.getLogger(__name__)

# The robot's joints come first in the model, and its actuators have the joints' order: these index qpos, qvel and ctrl.
BASE: Final = slice(0, 3)  # x, y (m, world frame), yaw (rad)
ARM: Final = slice(3, 9)  # waist, shoulder, elbow, roll, bend, twist (rad)
JOINTS: Final = 9
MOUNT: Final = "mount"  # the arm's mount on the base; axes as the base's
TOOL_TIP: Final = "tool_tip"


def load_model() -> Any:
    """Return the compiled MjModel."""
    return mujoco.MjModel.from_xml_string(files(__package__).joinpath("model.xml").read_text())


class Simulation:
    """Steps the physics.

    Attributes:
        joints: positions of the robot's joints, base first (a view)
        joint_velocities: velocities of the same joints (a view)
        restarts: number of times that a diverged state was put back to its beginning
    """

    def __init__(self) -> None:
        mujoco.set_mju_user_warning(warn)  # else MuJoCo writes a file into the working directory
        self.model = load_model()
        self.data = mujoco.MjData(self.model)
        self.joints: Array = self.data.qpos[:JOINTS]
        self.joint_velocities: Array = self.data.qvel[:JOINTS]
        self._velocities: Array = self.data.qvel
        self.restarts = 0
        self._home = self.model.key("home").id
        self._tip = self.model.site(TOOL_TIP).id
        self._jacobian = np.zeros((2, 3, self.model.nv))  # linear, angular
        self.restart()

    def restart(self) -> None:
        """Put everything back to its beginning, at rest."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, self._home)
        self.data.ctrl[ARM] = self.data.qpos[ARM]
        mujoco.mj_forward(self.model, self.data)

    def step(self, count: int) -> bool:
        """Let `count` timesteps pass. False if the state diverged and was put back to its beginning."""
        before = self.data.time
        mujoco.mj_step(self.model, self.data, count)
        if self.data.time > before and math.isfinite(self._velocities.dot(self._velocities)):
            return True
        self.restarts += 1  # MuJoCo resets the state, and with it the time, when it finds a value that is not finite
        self.restart()
        return False

    def snapshot(self) -> Array:
        """Return the part of the present state that a picture needs."""
        return self.data.qpos.copy()  # type: ignore[no-any-return]

    def base_velocity(self) -> Array:
        """Return vx, vy, wz of the base in its own frame."""
        return base_from_world(self.data.qpos[2]) @ self.data.qvel[BASE]  # type: ignore[no-any-return]

    def tool_jacobian(self) -> Array:
        """Return the tool tip's twist against the base, in the base frame, per velocity of each arm joint (6 x 6)."""
        linear, angular = self._jacobian
        mujoco.mj_jacSite(self.model, self.data, linear, angular, self._tip)
        rotated: Array = base_from_world(self.data.qpos[2]) @ self._jacobian[:, :, ARM]
        return rotated.reshape(6, -1)

    def tool_twist(self) -> Array:
        """Return the tool's measured twist against the base, in the base frame."""
        return self.tool_jacobian() @ self.data.qvel[ARM]  # type: ignore[no-any-return]


def warn(text: str) -> None:
    _logger.warning("MuJoCo: %s", text)


def base_from_world(yaw: float) -> Array:
    """Return the rotation that expresses a world vector in the base frame."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array(((cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0)))
