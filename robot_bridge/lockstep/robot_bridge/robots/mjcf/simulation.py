"""The physics of a model: its state, and how fast it is stepped."""

import logging
import math
import time
from typing import Any, Final

import mujoco
import numpy as np
import numpy.typing as npt

__all__ = ["Simulation"]

TICK: Final = 0.004  # s, about
BUSIEST: Final = 0.6  # share of a tick that the simulation may take
TRIED_TICKS: Final = 25

_logger = logging.getLogger(__name__)


class Simulation:
    """Steps the physics.

    Attributes:
        tick_seconds: s of the robot that a tick should take
        restarts: number of times that a diverged state was put back to its beginning
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.restarts = 0
        step = float(model.opt.timestep)
        self._steps = max(1, round(TICK / step))
        self.tick_seconds = self._steps * step
        self._slowness = 1.0  # how many times slower than real time the simulation runs
        self.restart()

    @property
    def faults(self) -> list[str]:
        found = []
        if self.restarts:
            found.append(f"the simulation diverged and was restarted ({self.restarts} times)")
        if self._slowness > 1:
            found.append(f"the simulation runs {self._slowness:.1f} times slower than real time")
        return found

    def restart(self) -> None:
        """Set the model's first keyframe if it has one, else its zero; nothing moves yet."""
        if self.model.nkey:
            mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
            self.data.qvel[:] = 0
        else:
            mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)

    def keep_up(self) -> None:
        """Reduce the steps of a tick if they would take too long: they must leave the loop some time.

        It tries the controls that are set, and restarts.
        """
        began = time.process_time()
        mujoco.mj_step(self.model, self.data, self._steps * TRIED_TICKS)
        taken = (time.process_time() - began) / TRIED_TICKS
        self.restart()
        fitting = max(1, math.floor(self._steps * BUSIEST * self.tick_seconds / max(taken, 1e-9)))
        if fitting < self._steps:
            self._slowness = self._steps / fitting
            _logger.warning("the simulation takes too long: it runs %.1f times slower than real time", self._slowness)
            self._steps = fitting

    def tick(self) -> bool:
        """Let a tick pass. False if the state diverged and was put back to its beginning."""
        before = self.data.time
        mujoco.mj_step(self.model, self.data, self._steps)
        if self.data.time > before and np.isfinite(self.data.qvel).all():
            return True
        self.restarts += 1  # MuJoCo resets the state, and with it the time, when it finds a value that is not finite
        self.restart()
        return False

    def snapshot(self) -> npt.NDArray[np.float64]:
        """Return the part of the present state that a picture needs."""
        state: npt.NDArray[np.float64] = self.data.qpos.copy()
        return state
