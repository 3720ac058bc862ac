"""Drives the holonomic base: turns velocities in the base frame into wheel motors and a parking brake."""

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from lockstep.robot_bridge.robots.mobile_manipulator.simulation import BASE

__all__ = ["BaseDrive"]

Array = npt.NDArray[np.float64]

PARKING_SPEED: Final = 0.02  # m/s and rad/s below which a base with a command to rest is parked
PARKING_SLIP: Final = np.array((0.01, 0.01, 0.02))  # m, m, rad: pushed farther, a parked base gives way
PARKING_STIFFNESS: Final = np.array((30000.0, 30000.0, 2500.0))  # N/m, N/m, N m/rad


class BaseDrive:
    """Drives velocity motors. At rest a brake holds the place, or the arm's push would move the base."""

    def __init__(self) -> None:
        self._parked: Array | None = None  # pose that the brake holds; None while driving

    def release(self) -> None:
        """Forget the held place."""
        self._parked = None

    def drive(self, data: Any, velocity: Sequence[float]) -> None:
        """Use `velocity` (vx, vy, wz in the base frame) for the coming step."""
        yaw = data.qpos[2]
        cosine, sine = math.cos(yaw), math.sin(yaw)
        forward, left, turn = velocity
        data.ctrl[BASE] = (cosine * forward - sine * left, sine * forward + cosine * left, turn)
        if forward or left or turn:
            self._parked = None
            data.qfrc_applied[BASE] = 0.0
        else:
            data.qfrc_applied[BASE] = self._brake(data.qpos[BASE], data.qvel[BASE])

    def _brake(self, pose: Array, speed: Array) -> Array:
        if self._parked is None:
            if np.abs(speed).max() > PARKING_SPEED:
                return np.zeros(3)
            self._parked = pose.copy()
        self._parked = np.clip(self._parked, pose - PARKING_SLIP, pose + PARKING_SLIP)
        return PARKING_STIFFNESS * (self._parked - pose)
