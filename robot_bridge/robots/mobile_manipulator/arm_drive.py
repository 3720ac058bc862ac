"""Drives the arm: a twist of the tool in, position servos out, which hold their posture at rest."""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from robot_bridge.robots.mobile_manipulator.resolved_rates import Resolution, ResolvedRates
from robot_bridge.robots.mobile_manipulator.simulation import ARM, JOINTS, Simulation

__all__ = ["ArmDrive"]

Array = npt.NDArray[np.float64]

FASTEST: Final = np.array((1.5, 1.5, 1.8, 2.5, 2.5, 3.0))  # rad/s
STEADY: Final = 0.002  # rad; an arm that has moved less makes the same of a twist, to within a hundredth
LEAD: Final = np.array((0.065, 0.065, 0.065, 0.08, 0.08, 0.08))  # rad, with the servos' stiffness the largest push


class _Resolved(NamedTuple):
    twist: bytes
    joints: Array  # rad, in which posture
    resolution: Resolution


class ArmDrive:
    """Joint velocities are summed to a posture that the servos hold.

    The posture never leads the measured one by more than LEAD, which bounds the push of an arm that is blocked and
    keeps it from storing up motion.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        model = simulation.model
        lower, upper = model.jnt_range[ARM, 0].copy(), model.jnt_range[ARM, 1].copy()
        self._names = tuple(model.joint(index).name.removeprefix("arm.") for index in range(ARM.start, JOINTS))
        self._lower, self._upper = lower, upper
        self._rates = ResolvedRates(lower, upper, FASTEST)
        self._lag = -model.actuator_biasprm[ARM, 2] / model.actuator_gainprm[ARM, 0]  # s, kv / kp of each servo
        self._posture = simulation.joints[ARM].copy()
        self._resolved: _Resolved | None = None  # the last one
        self.faults: list[str] = []

    def release(self) -> None:
        """Hold the posture that the arm has now."""
        self._posture = self._simulation.joints[ARM].copy()
        self.faults = []

    def rates(self, twist: Array) -> Array:
        """Velocities of the joints, rad/s, that `twist` would cause in the posture of now."""
        if not twist.any():
            return np.zeros(len(twist))
        return self._resolve(twist).velocities

    def drive(self, twist: Array, seconds: float) -> None:
        """Use `twist` (base frame, m/s and rad/s) for the coming `seconds`."""
        joints = self._simulation.joints[ARM]
        self.faults = []
        velocities = self._follow(twist) if twist.any() else np.zeros(len(joints))
        posture = self._posture + velocities * seconds
        posture = np.minimum(np.maximum(posture, joints - LEAD), joints + LEAD)
        self._posture = np.minimum(np.maximum(posture, self._lower), self._upper)
        # A servo follows a moving target with the lag kv/kp; aiming ahead by it makes the arm stop where it is told.
        self._simulation.data.ctrl[ARM] = self._posture + velocities * self._lag

    def _resolve(self, twist: Array) -> Resolution:
        joints, key, known = self._simulation.joints[ARM], twist.tobytes(), self._resolved
        if known is None or known.twist != key or np.abs(joints - known.joints).max() >= STEADY:
            resolution = self._rates.resolve(self._simulation.tool_jacobian(), twist, joints)
            known = self._resolved = _Resolved(key, joints.copy(), resolution)
        return known.resolution

    def _follow(self, twist: Array) -> Array:
        resolution = self._resolve(twist)
        self.faults = [f"arm joint limit: {self._names[index]}" for index in resolution.limited]
        if resolution.lost:
            self.faults.append("arm cannot reach farther this way")
        return resolution.velocities
